#pragma once

#include <yaml-cpp/yaml.h>

#include <string>

namespace pmeta {

/// A node as text for people: a word as it stands, all else as YAML in one line.
std::string textOf(const YAML::Node& node);

}  // namespace pmeta
