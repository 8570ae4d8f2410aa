#include "launch/launch_parent.h"

#include <unistd.h>

#include <fstream>

namespace pmeta_nodes {

std::vector<std::string> launchCommand() {
  std::ifstream in("/proc/" + std::to_string(getppid()) + "/cmdline");
  std::vector<std::string> words;
  for (std::string word; std::getline(in, word, '\0');) words.push_back(word);
  // its interpreter comes first
  for (std::size_t i = 0; i < words.size() && i < 2; ++i) {
    if (words[i].substr(words[i].rfind('/') + 1) == "roslaunch") return words;
  }
  return {};
}

}  // namespace pmeta_nodes
