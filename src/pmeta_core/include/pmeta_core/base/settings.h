#pragma once

#include <yaml-cpp/yaml.h>

#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "pmeta_core/base/names.h"

namespace pmeta {

/// Closed or open interval that a number must lie in.
struct Range {
  double low = -std::numeric_limits<double>::infinity();  ///< none if it is infinite
  double high = std::numeric_limits<double>::infinity();  ///< none if it is infinite
  bool low_open = false;                                  ///< is `low` itself refused?
  bool high_open = false;                                 ///< is `high` itself refused?

  /// [low, infinity).
  static Range atLeast(double low) { return {low, std::numeric_limits<double>::infinity()}; }
  /// (low, infinity).
  static Range above(double low) {
    return {low, std::numeric_limits<double>::infinity(), true, false};
  }
  /// [low, high].
  static Range between(double low, double high) { return {low, high}; }
  /// [low, high).
  static Range halfOpen(double low, double high) { return {low, high, false, true}; }

  bool contains(double value) const;  ///< false for NaN, too
  std::string text() const;           ///< "at least 0", "from 0 to 1", "any"; for error messages
};

/// Whether a list may be empty.
enum class Empty { kRefused, kAllowed };

/// The settings of a program: typed variables bound to dotted keys ("personal.lambda").
///
/// Each binding gives the key, the variable (which holds the default), its meaning and what is
/// allowed; reading, overriding, printing and saving all follow from it. Whatever is not bound is
/// an unknown key. Every failure throws Error with one sentence: the key, the value, what is
/// allowed, and for an unknown key the nearest known one. Bound variables must outlive the object.
class Settings {
 public:
  /// `key`: dotted, each once; `value`: the default until it is read; `doc`: a clause for the list
  /// of settings; `range`: what is allowed.
  void bind(const std::string& key, double& value, const std::string& doc, Range range = {});
  /// -1, which `range` leaves out, stands for no value.
  void bind(const std::string& key, std::optional<double>& value, const std::string& doc,
            Range range);
  /// A whole number.
  void bind(const std::string& key, int& value, const std::string& doc, Range range = {});
  /// A whole number.
  void bind(const std::string& key, std::int64_t& value, const std::string& doc, Range range = {});
  /// true or false.
  void bind(const std::string& key, bool& value, const std::string& doc);
  /// `choices`: the allowed words; empty means any text.
  void bind(const std::string& key, std::string& value, const std::string& doc,
            const std::vector<std::string>& choices = {});
  /// `range` holds for each element of a list.
  void bind(const std::string& key, std::vector<int>& value, const std::string& doc,
            Range range = {}, Empty empty = Empty::kRefused);
  /// The same of numbers with decimals.
  void bind(const std::string& key, std::vector<double>& value, const std::string& doc,
            Range range = {}, Empty empty = Empty::kRefused);
  /// Words; `choices` holds for each.
  void bind(const std::string& key, std::vector<std::string>& value, const std::string& doc,
            std::vector<std::string> choices = {}, Empty empty = Empty::kRefused);

  /// Reads a map of (nested) settings; `source` names it in errors.
  void read(const YAML::Node& root, const std::string& source);

  /// Applies "key:=value"; the key may be shortened to its last parts where that is unambiguous: of
  /// several keys that end so, to that with the fewest parts.
  /// The value is YAML, e.g. "lambda:=5" or "sizes:=[4,5]".
  void assign(const std::string& assignment);

  /// The full key that `name` (full or shortened) stands for.
  std::string resolve(const std::string& name, const std::string& source) const;

  /// The value of a setting as YAML text; `name` as resolve() takes it.
  std::string text(const std::string& name, const std::string& source) const;

  /// Every setting as YAML text, in binding order. Reading it again gives the same values.
  std::string yaml() const;

  /// An aligned table for people: key, value, "(default)" where unchanged; on request with
  /// meanings, and with the default where changed.
  std::string table(bool with_docs = false) const;

 private:
  struct Entry {
    std::string key;
    std::string doc;
    std::string allowed;
    std::string initial;  ///< the default, as text
    std::function<void(const YAML::Node&, const std::string& where)> read;
    std::function<std::string()> text;
  };

  void add(Entry entry);
  void readMap(const YAML::Node& map, const std::string& prefix, const std::string& source,
               std::set<std::string>& seen);
  const Entry* find(const std::string& key) const;
  [[noreturn]] void refuseUnknown(const std::string& name, const std::string& where) const;

  std::vector<Entry> entries_;
};

/// The shortest text that reads back as exactly this number.
std::string formatNumber(double value);

/// Loads a YAML file; throws Error if it is missing, unreadable, malformed or not a map.
YAML::Node loadYamlFile(const std::string& path);

/// Parses YAML text that must be a map; `source` names it in errors.
YAML::Node parseYaml(const std::string& text, const std::string& source);

/// (full key, value as YAML text) of a map of (nested) settings, in the order in which they stand;
/// an empty group is "{}", or "~" if it is nothing.
using ListedSettings = std::vector<std::pair<std::string, std::string>>;
ListedSettings listedSettings(const YAML::Node& map);  ///< of that map

/// The same by key.
std::map<std::string, std::string> flatSettings(const YAML::Node& map);

}  // namespace pmeta
