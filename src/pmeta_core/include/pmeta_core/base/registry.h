#pragma once

#include <map>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "pmeta_core/base/build.h"
#include "pmeta_core/base/error.h"
#include "pmeta_core/base/names.h"

namespace pmeta {

/// What there is of one kind (learners, environments, ...), by name. Each row stands beside the
/// code that it makes known, as a `const Registered<Row>` outside of any function; a library that
/// is loaded later adds its rows then.
template <class Row>
class Registry {
 public:
  /// `kind`: what a row is, for errors, e.g. "environment".
  explicit Registry(std::string kind) : kind_(std::move(kind)) {}

  /// `package`: that it is of. Throws std::logic_error if the name is taken.
  void add(const std::string& name, Row row, Package package = {}) {
    if (!rows_.emplace(name, Entry{std::move(row), std::move(package)}).second) {
      throw std::logic_error("two of kind " + kind_ + " have the name '" + name + "'");
    }
  }

  /// Throws Error if there is none of that name, with the known names and the nearest.
  const Row& at(const std::string& name) const {
    if (const Row* row = find(name)) return *row;
    throw Error(unknownName(kind_, name, names()));
  }

  /// Null if there is none of that name.
  const Row* find(const std::string& name) const {
    const auto found = rows_.find(name);
    return found == rows_.end() ? nullptr : &found->second.row;
  }

  /// Which package the row of that name is of. Throws as at() does.
  const Package& package(const std::string& name) const {
    at(name);
    return rows_.at(name).package;
  }

  /// Ascending.
  std::vector<std::string> names() const {
    std::vector<std::string> names;
    for (const auto& row : rows_) names.push_back(row.first);
    return names;
  }

 private:
  struct Entry {
    Row row;
    Package package;
  };

  std::string kind_;
  std::map<std::string, Entry> rows_;
};

/// While a library is being loaded, from where no exception gets out: notes why it must not be, for
/// loadLibrary() to throw. Otherwise throws std::logic_error.
void refuseRow(const std::string& why);

/// A row that is in a registry from the program's (or library's) start on.
template <class Row>
struct Registered {
  /// Adds the row under `name`, unless that is taken or the library does not fit: see refuseRow().
  /// `build` is the caller's, whose code this may not be.
  Registered(Registry<Row>& registry, const std::string& name, Row row,
             const Build& build = kThisBuild) {
    try {
      if (const std::string why = misfit(build); !why.empty()) throw std::logic_error(why);
      registry.add(name, std::move(row), {build.package, build.package_version});
    } catch (const std::logic_error& error) {
      refuseRow(error.what());
    }
  }
};

}  // namespace pmeta
