#pragma once

#include <string>

namespace pmeta_nodes {

// Private parameters of a node, or `otherwise` where they are not set. They throw pmeta::Error,
// which says what is allowed, if one is of another type or out of its range.

bool privateFlag(const std::string& name, bool otherwise);                       ///< true or false
std::string privateText(const std::string& name, const std::string& otherwise);  ///< any text
/// From 0 to `most`; `otherwise` may lie outside.
int privateIndex(const std::string& name, int otherwise, int most);
/// In (0, most].
double privatePositive(const std::string& name, double otherwise, double most);

}  // namespace pmeta_nodes
