#include "pmeta_core/base/settings.h"

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <set>
#include <sstream>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/file.h"
#include "pmeta_core/base/format.h"
#include "pmeta_core/base/number.h"

namespace pmeta {
namespace {

constexpr std::size_t kLongestName = 200;

std::size_t editDistance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t substitute = diagonal + (a[i - 1] != b[j - 1]);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, substitute});
    }
  }
  return row.back();
}

std::string lastPart(const std::string& key) {
  const auto dot = key.rfind('.');
  return dot == std::string::npos ? key : key.substr(dot + 1);
}

std::string where(const std::string& source, const YAML::Node& node) {
  const int line = node.Mark().line;
  return line < 0 ? source : source + " line " + std::to_string(line + 1);
}

std::string textOf(const YAML::Node& node) {
  if (node.IsScalar()) return node.Scalar();
  std::string text = YAML::Dump(node);
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text.empty() ? "null" : text;
}

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

// text as YAML, also within a list: bare if it is a plain word, else in double quotes
std::string quoted(const std::string& text) {
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

void Settings::add(Entry entry) {
  if (find(entry.key) != nullptr) throw std::logic_error("setting bound twice: " + entry.key);
  entry.initial = entry.text();
  entries_.push_back(std::move(entry));
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
         if (!node.IsScalar() || (!choices.empty() && !contains(choices, node.Scalar()))) {
           refuse(key, node, where, allowed);
         }
         value = node.Scalar();
       },
       [&value] { return quoted(value); }});
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
                    std::vector<std::string> choices) {
  const std::string allowed =
      choices.empty() ? "a list of words" : "a list of words out of " + join(choices);
  add({key, doc, allowed, "",
       [=, &value](const YAML::Node& node, const std::string& where) {
         value = readList<std::string>(key, node, where, allowed,
                                       [&](const YAML::Node& one, std::string& out) {
                                         if (!one.IsScalar()) return false;
                                         out = one.Scalar();
                                         return choices.empty() || contains(choices, out);
                                       });
       },
       [&value] { return listText<std::string>(value, quoted); }});
}

void Settings::read(const YAML::Node& root, const std::string& source) {
  if (!root.IsMap()) throw Error(source + " must hold settings as 'key: value' lines.");
  std::set<std::string> seen;
  readMap(root, "", source, seen);
}

void Settings::readMap(const YAML::Node& map, const std::string& prefix, const std::string& source,
                       std::set<std::string>& seen) {
  for (const auto& item : map) {
    const std::string key = prefix + textOf(item.first);
    if (!seen.insert(key).second) {
      throw Error("setting " + shown(key) + " stands twice (" + where(source, item.first) +
                  "): keep one of them.");
    }
    if (const Entry* entry = find(key)) {
      entry->read(item.second, where(source, item.first));
      continue;
    }
    const bool is_section = std::any_of(entries_.begin(), entries_.end(), [&](const Entry& entry) {
      return entry.key.rfind(key + ".", 0) == 0;
    });
    if (!is_section) refuseUnknown(key, where(source, item.first));
    if (!item.second.IsMap()) {
      throw Error("'" + key + "' is a group of settings (" + where(source, item.first) +
                  "): write its keys below it, indented.");
    }
    readMap(item.second, key + ".", source, seen);
  }
}

void Settings::assign(const std::string& assignment) {
  const auto split = assignment.find(":=");
  if (split == std::string::npos || split == 0) {
    throw Error("'" + assignment + "' is not an assignment: write key:=value.");
  }
  const std::string source = "given as " + assignment;
  const std::string key = resolve(assignment.substr(0, split), source);
  const std::string text = assignment.substr(split + 2);
  YAML::Node value;
  try {
    value = YAML::Load(text);
  } catch (const YAML::Exception& error) {
    throw Error("the value of " + assignment + " is not valid YAML: " + error.msg + ".");
  }
  // what YAML takes for nothing ("", "~", "#5") is meant as it stands
  find(key)->read(value.IsNull() ? YAML::Node(text) : value, source);
}

std::string Settings::resolve(const std::string& name, const std::string& source) const {
  if (find(name) != nullptr) return name;
  std::vector<std::string> matches;
  for (const Entry& entry : entries_) {
    if (lastPart(entry.key) == name) matches.push_back(entry.key);
  }
  if (matches.empty()) refuseUnknown(name, source);
  if (matches.size() > 1) {
    throw Error("setting '" + name + "' is ambiguous: write one of " + join(matches) + ".");
  }
  return matches.front();
}

std::string Settings::yaml() const {
  std::ostringstream out;
  std::string section;
  std::set<std::string> written;
  for (const Entry& entry : entries_) {
    const auto dot = entry.key.find('.');
    const std::string group = dot == std::string::npos ? "" : entry.key.substr(0, dot);
    if (group != section && !group.empty()) {
      // a group may stand but once: what is bound to it later is written with its full key
      if (!written.insert(group).second) {
        section.clear();
        out << entry.key << ": " << entry.text() << "\n";
        continue;
      }
      out << group << ":\n";
    }
    section = group;
    out << (group.empty() ? "" : "  ") << (group.empty() ? entry.key : entry.key.substr(dot + 1))
        << ": " << entry.text() << "\n";
  }
  return out.str();
}

std::string Settings::table(bool with_docs) const {
  std::size_t key_width = 0;
  for (const Entry& entry : entries_) key_width = std::max(key_width, entry.key.size());
  std::ostringstream out;
  for (const Entry& entry : entries_) {
    const std::string text = entry.text();
    out << "  " << entry.key << std::string(key_width - entry.key.size() + 2, ' ') << text;
    if (text == entry.initial) {
      out << "  (default)";
    } else if (with_docs) {
      out << "  (default: " << entry.initial << ")";
    }
    out << "\n";
    if (with_docs) {
      out << "  " << std::string(key_width + 2, ' ') << entry.doc << " [" << entry.allowed << "]\n";
    }
  }
  return out.str();
}

const Settings::Entry* Settings::find(const std::string& key) const {
  for (const Entry& entry : entries_) {
    if (entry.key == key) return &entry;
  }
  return nullptr;
}

void Settings::refuseUnknown(const std::string& name, const std::string& where) const {
  std::vector<std::string> keys;
  for (const Entry& entry : entries_) keys.push_back(entry.key);
  const auto withLastPart = [&](const std::string& last) {
    const auto found = std::find_if(keys.begin(), keys.end(),
                                    [&](const std::string& key) { return lastPart(key) == last; });
    return found == keys.end() ? std::string() : *found;
  };
  // a right name in the wrong group, a misspelt key, or a misspelt short name
  std::string best = withLastPart(lastPart(name));
  if (best.empty()) best = nearest(name, keys);
  if (best.empty()) {
    std::vector<std::string> short_names;
    for (const std::string& key : keys) short_names.push_back(lastPart(key));
    best = withLastPart(nearest(lastPart(name), short_names));
  }
  throw Error(
      "unknown setting " + shown(name) + " (" + where + ")" +
      (best.empty() ? "; known are " + join(keys) + "." : ": did you mean '" + best + "'?"));
}

std::string formatNumber(double value) {
  const NumbersWithDots dots;
  char text[40];
  for (int digits = 6; digits <= 17; ++digits) {
    std::snprintf(text, sizeof text, "%.*g", digits, value);
    if (std::strtod(text, nullptr) == value) break;
  }
  return text;
}

YAML::Node parseYaml(const std::string& text, const std::string& source) {
  std::vector<YAML::Node> documents;
  try {
    documents = YAML::LoadAll(text);
  } catch (const YAML::Exception& error) {
    throw Error(source + " line " + std::to_string(error.mark.line + 1) +
                " is not valid YAML: " + error.msg + ".");
  }
  if (documents.size() > 1) {
    throw Error(where(source, documents[1]) +
                " is in a second YAML document, which is not read: remove the '---' before it.");
  }
  const YAML::Node root = documents.empty() ? YAML::Node() : documents.front();
  if (!root.IsMap()) throw Error(source + " must hold settings as 'key: value' lines.");
  return root;
}

YAML::Node loadYamlFile(const std::string& path) {
  return parseYaml(readFileOrPipe(path, "the settings file"), path);
}

std::map<std::string, std::string> flatSettings(const YAML::Node& map) {
  std::map<std::string, std::string> values;
  for (const auto& item : map) {
    const std::string key = item.first.Scalar();
    if (!item.second.IsMap()) {
      values[key] = YAML::Dump(item.second);
      continue;
    }
    for (const auto& inner : flatSettings(item.second))
      values[key + "." + inner.first] = inner.second;
  }
  return values;
}

std::string nearest(const std::string& word, const std::vector<std::string>& candidates) {
  std::string best;
  std::size_t best_distance = std::max<std::size_t>(2, word.size() / 4) + 1;
  for (const std::string& candidate : candidates) {
    const std::size_t distance = editDistance(word, candidate);
    if (distance < best_distance) {
      best_distance = distance;
      best = candidate;
    }
  }
  return best;
}

void requirePlainName(const std::string& key, const std::string& value) {
  if (value.empty() || value.find_first_of("/ \\\"'") != std::string::npos || value == "." ||
      value == ".." || !isPlainText(value)) {
    throw Error(key + " is " + shown(value) +
                " but must be a plain name in UTF-8, without blanks, quotes or slashes.");
  }
  if (value.size() > kLongestName) {
    throw Error(key + " is " + shown(value) + ", a name of " + std::to_string(value.size()) +
                " bytes, but must have at most " + std::to_string(kLongestName) + ".");
  }
}

std::string join(const std::vector<std::string>& words, const std::string& separator) {
  std::string text;
  for (std::size_t i = 0; i < words.size(); ++i) text += (i == 0 ? "" : separator) + words[i];
  return text;
}

}  // namespace pmeta
