#include "launch/launch_words.h"

#include <ros/package.h>

#include <algorithm>
#include <regex>
#include <sstream>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/file.h"
#include "pmeta_core/base/format.h"

namespace pmeta_nodes {

namespace {

namespace fs = std::filesystem;
using pmeta::Error;
using pmeta::shown;

const char kBlanks[] = " \t\n\r";
const char kOfPmeta[] = "<include file=\"$(find pmeta_nodes)/launch/";

std::string trim(const std::string& text) {
  const auto begin = text.find_first_not_of(kBlanks);
  if (begin == std::string::npos) return "";
  return text.substr(begin, text.find_last_not_of(kBlanks) - begin + 1);
}

std::string keyOf(const std::string& word) { return trim(word.substr(0, word.find(":="))); }

// all first groups of a pattern's matches
void collect(const std::string& text, const char* pattern, std::set<std::string>& names) {
  const std::regex regex(pattern);
  for (std::sregex_iterator match(text.begin(), text.end(), regex), end; match != end; ++match) {
    names.insert((*match)[1]);
  }
}

// one past the value that begins at `begin`, as YAML would read it in a list of blanks
std::size_t endOfValue(const std::string& text, std::size_t begin) {
  const auto is = [](char c, const char* any) {
    return std::string(any).find(c) != std::string::npos;
  };
  if (begin == text.size() || !is(text[begin], "[{'\"")) {
    return std::min(text.find_first_of(kBlanks, begin), text.size());
  }
  int depth = 0;
  char quote = 0;
  char before = ',';  // the last character that is not blank: quotes open at a value's start
  for (std::size_t i = begin; i < text.size(); ++i) {
    const char c = text[i];
    if (quote == '"' && c == '\\') {
      ++i;
    } else if (quote != 0) {
      if (c == quote) quote = 0;
    } else if (is(c, "'\"") && is(before, ",[{:'\"")) {
      quote = c;
    } else if (is(c, "[{")) {
      ++depth;
    } else if (is(c, "]}")) {
      --depth;
    }
    if (!is(c, kBlanks)) before = c;
    if (quote == 0 && depth == 0 && (i + 1 == text.size() || is(text[i + 1], kBlanks)))
      return i + 1;
  }
  throw Error("in settings, the value " + shown(text.substr(begin)) +
              " does not end: close its bracket or quote.");
}

// The launch file that roslaunch was called with, if it is one of the folder, or another's that
// includes one of it; else "".
fs::path launchFileOf(const std::vector<std::string>& command, const fs::path& folder) {
  for (std::size_t i = 1; i < command.size(); ++i) {
    if (fs::path(command[i]).extension() != ".launch") continue;
    if (command[i - 1] == "pmeta_nodes") return folder / command[i];
    std::error_code error;
    fs::path file = fs::weakly_canonical(command[i], error);
    if (file.parent_path() == fs::weakly_canonical(folder, error)) return file;
    if (!fs::is_regular_file(file, error)) {
      file = fs::path(ros::package::getPath(command[i - 1])) / "launch" / command[i];
      if (!fs::is_regular_file(file, error)) return "";
    }
    const std::string text = pmeta::readFile(file.string(), "the launch file");
    return text.find(kOfPmeta) == std::string::npos ? "" : file;
  }
  return "";
}

}  // namespace

LaunchArguments readLaunchFile(const fs::path& file, const fs::path& folder) {
  std::string text = pmeta::readFile(file.string(), "the launch file");
  std::set<std::string> beside, of_pmeta;
  collect(text, "<include file=\"\\$\\(dirname\\)/([^\"]+)\"", beside);
  collect(text, "<include file=\"\\$\\(find pmeta_nodes\\)/launch/([^\"]+)\"", of_pmeta);
  for (const std::string& name : beside)
    text += pmeta::readFile(file.parent_path() / name, "the launch file");
  for (const std::string& name : of_pmeta)
    text += pmeta::readFile(folder / name, "the launch file");
  LaunchArguments arguments;
  collect(text, "<arg name=\"([^\"]+)\"", arguments.names);
  collect(text, "\\b([a-z_]+):=\\$\\(arg \\1\\)", arguments.handed_on);
  collect(text, "<arg name=\"([^\"]+)\" default=\"(?:true|false|\\$\\(arg rviz\\))\"",
          arguments.switches);
  return arguments;
}

std::vector<std::string> handedOn(const std::vector<std::string>& words,
                                  const LaunchArguments& arguments) {
  std::vector<std::string> words_on;
  for (const std::string& word : words) {
    const auto split = word.find(":=");
    if (split == std::string::npos || split == 0) {
      throw Error(shown(word) + " is not an assignment: write key:=value.");
    }
    const std::string key = keyOf(word);
    const std::string value = trim(word.substr(split + 2));
    if (value.find(":=") != std::string::npos) {
      throw Error(shown(word) + " has a second ':=', which roslaunch does not take.");
    }
    if (arguments.switches.count(key) > 0) {
      static const std::set<std::string> known = {"true", "false", "True", "False", "1", "0"};
      if (known.count(value) == 0) {
        throw Error(key + " is " + shown(value) + " but must be true or false.");
      }
    }
    if (arguments.names.count(key) > 0 && value.find("$(") != std::string::npos) {
      throw Error(key + " is " + shown(value) + ", but roslaunch takes '$(' for a substitution.");
    }
    if (arguments.names.count(key) > 0 && arguments.handed_on.count(key) == 0) continue;
    if (!value.empty()) words_on.push_back(key + ":=" + value);
  }
  return words_on;
}

std::vector<std::string> splitSettings(const std::string& text) {
  std::vector<std::string> assignments;
  std::size_t begin = 0;
  while ((begin = text.find_first_not_of(kBlanks, begin)) != std::string::npos) {
    const std::size_t equals = text.find('=', begin);
    const std::size_t blank = std::min(text.find_first_of(kBlanks, begin), text.size());
    // a plain "=" here: roslaunch takes no second ":=" in an argument
    if (equals >= blank || equals == begin || text[equals - 1] == ':') {
      throw Error(shown(text.substr(begin, blank - begin)) +
                  " in settings is not of the form key=value.");
    }
    const std::size_t end = endOfValue(text, equals + 1);
    assignments.push_back(text.substr(begin, equals - begin) +
                          ":=" + text.substr(equals + 1, end - equals - 1));
    begin = end;
  }
  return assignments;
}

std::vector<std::string> wordsOfLaunch(const std::string& lines,
                                       const std::vector<std::string>& command,
                                       const fs::path& folder) {
  std::vector<std::string> given;
  const fs::path file = launchFileOf(command, folder);
  if (!file.empty()) {
    std::vector<std::string> words;
    for (const std::string& word : command) {
      // names that begin with _ are roslaunch's own, e.g. __log
      if (word.find(":=") != std::string::npos && word[0] != '_') words.push_back(word);
    }
    given = handedOn(words, readLaunchFile(file, folder));
  }
  std::vector<std::string> words;
  std::istringstream in(lines);
  for (std::string line; std::getline(in, line);) {
    line = trim(line);
    // the command line has it as it was typed
    const bool typed = std::any_of(given.begin(), given.end(), [&](const std::string& word) {
      return keyOf(word) == keyOf(line);
    });
    if (!line.empty() && !typed) words.push_back(line);
  }
  words.insert(words.end(), given.begin(), given.end());
  return words;
}

}  // namespace pmeta_nodes
