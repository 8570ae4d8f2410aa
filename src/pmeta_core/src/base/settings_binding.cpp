// How each type of setting is read and printed, and what is allowed of it.
#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cmath>
#include <cstdlib>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/format.h"
#include "pmeta_core/base/number.h"
#include "pmeta_core/base/settings.h"
#include "yaml_text.h"

namespace pmeta {
namespace {

// yaml-cpp's own conversion also takes words such as ".nan"
bool parseNumber(const YAML::Node& node, double& value) {
  return node.IsScalar() && pmeta::parseNumber(node.Scalar(), value);
}

// what is allowed of a whole number; with the largest there is, where that is what was passed
std::string allowedWhole(const YAML::Node& node, const std::string& allowed, std::int64_t most) {
  double number = 0;
  const bool beyond = parseNumber(node, number) && number > 0.5 * static_cast<double>(most);
  return beyond ? allowed + ", at most " + std::to_string(most) : allowed;
}

bool parseInteger(const YAML::Node& node, std::int64_t& value) {
  double number = 0;
  if (!parseNumber(node, number)) return false;
  const std::string& text = node.Scalar();
  errno = 0;
  char* end = nullptr;
  value = std::strtoll(text.c_str(), &end, 10);
  if (end == text.c_str() + text.size()) return errno == 0;
  // 1e5 and 3.0 are whole numbers too
  if (number != std::floor(number) || std::abs(number) > 9e15) return false;
  value = static_cast<std::int64_t>(number);
  return true;
}

[[noreturn]] void refuse(const std::string& key, const YAML::Node& node, const std::string& where,
                         const std::string& allowed) {
  throw Error(key + " is " + shown(textOf(node)) + " (" + where + ") but must be " + allowed + ".");
}

// `says`: "KEY is " or "KEY holds "
[[noreturn]] void refuseWord(const std::string& says, const std::string& word,
                             const std::string& where, const std::vector<std::string>& choices) {
  throw Error(says + shown(word) + " (" + where + ") but must be one of " + join(choices) +
              didYouMean(word, choices));
}

// text as YAML, also within a list: bare if it is a plain word, else in double quotes
std::string asYaml(const std::string& text) {
  // words that YAML would read as something else
  static const std::set<std::string> kReserved = {"null", "Null", "NULL", "true", "false",
                                                  "yes",  "no",   "on",   "off"};
  const bool bare = std::all_of(text.begin(), text.end(), [](unsigned char c) {
    return std::isalnum(c) != 0 || c == '_' || c == '/' || c == '.' || c == '-';
  });
  double number = 0;
  if (bare && !text.empty() && (std::isalpha(text[0]) != 0 || text[0] == '/') &&
      kReserved.count(text) == 0 && !parseNumber(YAML::Node(text), number)) {
    return text;
  }
  YAML::Emitter out;
  out << YAML::DoubleQuoted << text;
  return out.c_str();
}

std::string rangeSuffix(const Range& range) {
  const std::string text = range.text();
  return text == "any" ? "" : ", " + text;
}

bool contains(const std::vector<std::string>& words, const std::string& word) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

template <class T>
std::string listText(const std::vector<T>& values,
                     const std::function<std::string(const T&)>& one) {
  std::vector<std::string> words;
  for (const T& value : values) words.push_back(one(value));
  return "[" + join(words) + "]";
}

// reads a list (or a single value as a list of one), each element by `parse`
template <class T>
std::vector<T> readList(const std::string& key, const YAML::Node& node, const std::string& where,
                        const std::string& allowed,
                        const std::function<bool(const YAML::Node&, T&)>& parse,
                        Empty empty = Empty::kRefused) {
  std::vector<T> values;
  const auto take = [&](const YAML::Node& element) {
    T value{};
    if (!parse(element, value)) refuse(key, node, where, allowed);
    values.push_back(value);
  };
  if (node.IsSequence()) {
    for (const auto& element : node) take(element);
  } else {
    take(node);
  }
  if (values.empty() && empty == Empty::kRefused) refuse(key, node, where, allowed);
  return values;
}

}  // namespace

bool Range::contains(double value) const {
  return (low_open ? value > low : value >= low) && (high_open ? value < high : value <= high);
}

std::string Range::text() const {
  const bool has_low = std::isfinite(low);
  const bool has_high = std::isfinite(high);
  if (!has_low && !has_high) return "any";
  if (!has_high) return (low_open ? "above " : "at least ") + formatNumber(low);
  if (!has_low) return (high_open ? "below " : "at most ") + formatNumber(high);
  return std::string(low_open ? "above " : "from ") + formatNumber(low) +
         (high_open ? " to below " : " to ") + formatNumber(high);
}

void Settings::bind(const std::string& key, double& value, const std::string& doc, Range range) {
  const std::string allowed = "a number" + rangeSuffix(range);
  add({key, doc, allowed, "",
       [=, &value](const YAML::Node& node, const std::string& where) {
         double number = 0;
         if (!parseNumber(node, number) || !range.contains(number)) {
           refuse(key, node, where, allowed);
         }
         value = number;
       },
       [&value] { return formatNumber(value); }});
}

void Settings::bind(const std::string& key, std::optional<double>& value, const std::string& doc,
                    Range range) {
  const std::string allowed = "a number" + rangeSuffix(range) + ", or -1";
  add({key, doc, allowed, "",
       [=, &value](const YAML::Node& node, const std::string& where) {
         double number = 0;
         if (!parseNumber(node, number) || (!range.contains(number) && number != -1)) {
           refuse(key, node, where, allowed);
         }
         value = number == -1 ? std::nullopt : std::optional<double>(number);
       },
       [&value] { return formatNumber(value.value_or(-1)); }});
}

void Settings::bind(const std::string& key, std::int64_t& value, const std::string& doc,
                    Range range) {
  const std::string allowed = "a whole number" + rangeSuffix(range);
  add({key, doc, allowed, "",
       [=, &value](const YAML::Node& node, const std::string& where) {
         std::int64_t number = 0;
         if (!parseInteger(node, number) || !range.contains(static_cast<double>(number))) {
           refuse(key, node, where,
                  std::isfinite(range.high)
                      ? allowed
                      : allowedWhole(node, allowed, std::numeric_limits<std::int64_t>::max()));
         }
         value = number;
       },
       [&value] { return std::to_string(value); }});
}

void Settings::bind(const std::string& key, int& value, const std::string& doc, Range range) {
  range.low = std::max(range.low, static_cast<double>(std::numeric_limits<int>::min()));
  const std::string allowed = "a whole number" + rangeSuffix(range);
  add({key, doc, allowed, "",
       [=, &value](const YAML::Node& node, const std::string& where) {
         std::int64_t number = 0;
         if (!parseInteger(node, number) || !range.contains(static_cast<double>(number)) ||
             number > std::numeric_limits<int>::max()) {
           refuse(key, node, where,
                  std::isfinite(range.high)
                      ? allowed
                      : allowedWhole(node, allowed, std::numeric_limits<int>::max()));
         }
         value = static_cast<int>(number);
       },
       [&value] { return std::to_string(value); }});
}

void Settings::bind(const std::string& key, bool& value, const std::string& doc) {
  const std::string allowed = "true or false";
  add({key, doc, allowed, "",
       [=, &value](const YAML::Node& node, const std::string& where) {
         if (!node.IsScalar() || (node.Scalar() != "true" && node.Scalar() != "false")) {
           refuse(key, node, where, allowed);
         }
         value = node.Scalar() == "true";
       },
       [&value] { return std::string(value ? "true" : "false"); }});
}

void Settings::bind(const std::string& key, std::string& value, const std::string& doc,
                    const std::vector<std::string>& choices) {
  const std::string allowed = choices.empty() ? "text" : "one of " + join(choices);
  add({key, doc, allowed, "",
       [=, &value](const YAML::Node& node, const std::string& where) {
         if (!node.IsScalar()) refuse(key, node, where, allowed);
         if (!choices.empty() && !contains(choices, node.Scalar())) {
           refuseWord(key + " is ", node.Scalar(), where, choices);
         }
         value = node.Scalar();
       },
       [&value] { return asYaml(value); }});
}

void Settings::bind(const std::string& key, std::vector<int>& value, const std::string& doc,
                    Range range, Empty empty) {
  const std::string allowed = "a list of whole numbers" + rangeSuffix(range);
  add({key, doc, allowed, "",
       [=, &value](const YAML::Node& node, const std::string& where) {
         value = readList<int>(
             key, node, where, allowed,
             [&](const YAML::Node& one, int& out) {
               std::int64_t number = 0;
               if (!parseInteger(one, number) || !range.contains(static_cast<double>(number)) ||
                   number < std::numeric_limits<int>::min() ||
                   number > std::numeric_limits<int>::max()) {
                 return false;
               }
               out = static_cast<int>(number);
               return true;
             },
             empty);
       },
       [&value] {
         return listText<int>(value, [](const int& one) { return std::to_string(one); });
       }});
}

void Settings::bind(const std::string& key, std::vector<double>& value, const std::string& doc,
                    Range range, Empty empty) {
  const std::string allowed = "a list of numbers" + rangeSuffix(range);
  add({key, doc, allowed, "",
       [=, &value](const YAML::Node& node, const std::string& where) {
         value = readList<double>(
             key, node, where, allowed,
             [&](const YAML::Node& one, double& out) {
               return parseNumber(one, out) && range.contains(out);
             },
             empty);
       },
       [&value] { return listText<double>(value, formatNumber); }});
}

void Settings::bind(const std::string& key, std::vector<std::string>& value, const std::string& doc,
                    std::vector<std::string> choices, Empty empty) {
  const std::string allowed =
      choices.empty() ? "a list of words" : "a list of words out of " + join(choices);
  add({key, doc, allowed, "",
       [=, &value](const YAML::Node& node, const std::string& where) {
         value = readList<std::string>(
             key, node, where, allowed,
             [&](const YAML::Node& one, std::string& out) {
               if (!one.IsScalar()) return false;
               out = one.Scalar();
               if (!choices.empty() && !contains(choices, out)) {
                 refuseWord(key + " holds ", out, where, choices);
               }
               return true;
             },
             empty);
       },
       [&value] { return listText<std::string>(value, asYaml); }});
}

}  // namespace pmeta
