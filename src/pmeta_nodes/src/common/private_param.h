#pragma once

#include <map>
#include <string>
#include <vector>

namespace pmeta_nodes {

// Private parameters of a node, or `otherwise` where they are not set. They throw pmeta::Error,
// which says what is allowed, if one is of another type or out of its range.

bool privateFlag(const std::string& name, bool otherwise);                       ///< true or false
std::string privateText(const std::string& name, const std::string& otherwise);  ///< any text
/// From 0 to `most`; `otherwise` may lie outside.
int privateIndex(const std::string& name, int otherwise, int most);
/// A list of texts; an empty one where it is not set.
std::vector<std::string> privateNames(const std::string& name);
/// A number for each of several names; none where it is not set.
std::map<std::string, double> privateNumbers(const std::string& name);
/// In (0, most].
double privatePositive(const std::string& name, double otherwise, double most);

}  // namespace pmeta_nodes
