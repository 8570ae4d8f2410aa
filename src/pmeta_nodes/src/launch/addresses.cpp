#include "launch/addresses.h"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <memory>

namespace pmeta_nodes {
namespace {

// as in ROS, a name goes before an address
std::string setAddress() {
  for (const char* variable : {"ROS_HOSTNAME", "ROS_IP"}) {
    const char* value = std::getenv(variable);
    if (value != nullptr && *value != '\0') return value;
  }
  return "";
}

}  // namespace

bool isLoopback(const std::string& host) {
  return host == "localhost" || host == "::1" || host.rfind("127.", 0) == 0;
}

bool isHere(const std::string& host) {
  std::array<char, 256> name{};
  gethostname(name.data(), name.size() - 1);
  if (isLoopback(host) || host == name.data() || host == setAddress()) return true;
  const std::vector<std::string> own = ownAddresses();
  return std::find(own.begin(), own.end(), host) != own.end();
}

std::vector<std::string> ownAddresses() {
  ifaddrs* all = nullptr;
  if (getifaddrs(&all) != 0) return {};
  const std::unique_ptr<ifaddrs, void (*)(ifaddrs*)> owner(all, freeifaddrs);
  std::vector<std::string> addresses;
  for (const ifaddrs* one = all; one != nullptr; one = one->ifa_next) {
    if (one->ifa_addr == nullptr || one->ifa_addr->sa_family != AF_INET) continue;
    const auto* address = reinterpret_cast<const sockaddr_in*>(one->ifa_addr);
    std::array<char, INET_ADDRSTRLEN> text{};
    inet_ntop(AF_INET, &address->sin_addr, text.data(), text.size());
    if (!isLoopback(text.data())) addresses.emplace_back(text.data());
  }
  return addresses;
}

std::string givenOutAddress() {
  const std::string set = setAddress();
  return set.empty() ? "127.0.0.1" : set;
}

std::string addressSetting(const std::string& host) {
  in_addr address{};
  const bool is_number = inet_pton(AF_INET, host.c_str(), &address) == 1;
  return (is_number ? "ROS_IP=" : "ROS_HOSTNAME=") + host;
}

}  // namespace pmeta_nodes
