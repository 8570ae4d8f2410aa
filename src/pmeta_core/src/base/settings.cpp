#include "pmeta_core/base/settings.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <set>
#include <sstream>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/file.h"
#include "pmeta_core/base/format.h"
#include "pmeta_core/base/number.h"
#include "yaml_text.h"

namespace pmeta {
namespace {

std::string lastPart(const std::string& key) {
  const auto dot = key.rfind('.');
  return dot == std::string::npos ? key : key.substr(dot + 1);
}

// "forward.weight" and "weight" both stand for "environment.rewards.forward.weight"
bool endsWith(const std::string& key, const std::string& name) {
  const std::string end = "." + name;
  return key.size() > end.size() && key.compare(key.size() - end.size(), end.size(), end) == 0;
}

std::string where(const std::string& source, const YAML::Node& node) {
  const int line = node.Mark().line;
  return line < 0 ? source : source + " line " + std::to_string(line + 1);
}

}  // namespace

std::string textOf(const YAML::Node& node) {
  if (node.IsScalar()) return node.Scalar();
  std::string text = YAML::Dump(node);
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text.empty() ? "null" : text;
}

void Settings::add(Entry entry) {
  if (find(entry.key) != nullptr) throw std::logic_error("setting bound twice: " + entry.key);
  entry.initial = entry.text();
  entries_.push_back(std::move(entry));
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
  const auto depth = [](const std::string& key) { return std::count(key.begin(), key.end(), '.'); };
  for (const Entry& entry : entries_) {
    if (!endsWith(entry.key, name)) continue;
    // a group within a group takes no name from the one around it
    if (!matches.empty() && depth(entry.key) != depth(matches.front())) {
      if (depth(entry.key) > depth(matches.front())) continue;
      matches.clear();
    }
    matches.push_back(entry.key);
  }
  if (matches.empty()) refuseUnknown(name, source);
  if (matches.size() > 1) {
    throw Error("setting '" + name + "' is ambiguous: write one of " + join(matches) + ".");
  }
  return matches.front();
}

std::string Settings::text(const std::string& name, const std::string& source) const {
  return find(resolve(name, source))->text();
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

ListedSettings listedSettings(const YAML::Node& map) {
  ListedSettings values;
  for (const auto& item : map) {
    const std::string key = item.first.Scalar();
    if (!item.second.IsMap() || item.second.size() == 0) {
      values.emplace_back(key, YAML::Dump(item.second));
      continue;
    }
    for (const auto& [inner, value] : listedSettings(item.second)) {
      values.emplace_back(key + "." + inner, value);
    }
  }
  return values;
}

std::map<std::string, std::string> flatSettings(const YAML::Node& map) {
  const ListedSettings listed = listedSettings(map);
  return {listed.begin(), listed.end()};
}

}  // namespace pmeta
