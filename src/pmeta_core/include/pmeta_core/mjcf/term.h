#pragma once

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "pmeta_core/base/registry.h"
#include "pmeta_core/base/settings.h"
#include "pmeta_core/mjcf/elements.h"

namespace pmeta {

/// Where a term binds its settings: below its own name, "environment.rewards.forward.", say.
class TermSettings {
 public:
  /// `prefix`: of all keys, without the dot. `settings` must outlive this.
  TermSettings(Settings& settings, std::string prefix)
      : settings_(settings), prefix_(std::move(prefix)) {}

  /// As Settings::bind(), with the last part of the key.
  template <class Value>
  void bind(const std::string& name, Value& value, const std::string& doc) {
    settings_.bind(prefix_ + "." + name, value, doc);
  }
  /// The same of numbers.
  template <class Value>
  void bind(const std::string& name, Value& value, const std::string& doc, const Range& range) {
    settings_.bind(prefix_ + "." + name, value, doc, range);
  }
  /// The same of lists of numbers.
  template <class Value>
  void bind(const std::string& name, Value& value, const std::string& doc, const Range& range,
            Empty empty) {
    settings_.bind(prefix_ + "." + name, value, doc, range, empty);
  }
  /// The same of words.
  template <class Value>
  void bind(const std::string& name, Value& value, const std::string& doc,
            const std::vector<std::string>& choices) {
    settings_.bind(prefix_ + "." + name, value, doc, choices);
  }

 private:
  Settings& settings_;
  std::string prefix_;
};

/// One term of an environment that is written in YAML: what it observes, rewards and so on. Its
/// settings are members; once find() has been called it never changes, so that environments share
/// it.
class Term {
 public:
  virtual ~Term() = default;

  /// Binds its settings.
  virtual void bind(TermSettings& settings) = 0;

  /// Looks up what its settings name, and checks them against the model; throws Error.
  virtual void find(const Elements& elements) = 0;
};

/// A kind of term, of those of one section.
template <class Kind>
struct TermRow {
  std::string meaning;                          ///< a clause with the unit, for people
  std::function<std::unique_ptr<Kind>()> make;  ///< one with default settings
};

/// Every kind of term of that section, by the name that `term` gives.
template <class Kind>
Registry<TermRow<Kind>>& termsOf() {
  return Kind::registry();
}

/// In the source of a term, outside of any function:
///
///     const RegisteredTerm<RewardTerm, Alive> kAlive("alive", "1 in every step");
template <class Kind, class Made>
struct RegisteredTerm : Registered<TermRow<Kind>> {
  /// Throws std::logic_error if the name is taken.
  RegisteredTerm(const std::string& name, const std::string& meaning)
      : Registered<TermRow<Kind>>(Kind::registry(), name,
                                  {meaning, [] { return std::make_unique<Made>(); }}) {}
};

}  // namespace pmeta
