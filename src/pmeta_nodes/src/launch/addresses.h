#pragma once

#include <string>
#include <vector>

namespace pmeta_nodes {

/// Is it an address or name at which only this machine reaches itself?
bool isLoopback(const std::string& host);

/// Is it an address or name of this machine?
bool isHere(const std::string& host);

/// This machine's IPv4 addresses, but for loopback.
std::vector<std::string> ownAddresses();

/// What nodes that a launch file of pMeta's starts here give out as their address.
std::string givenOutAddress();

/// What sets the address that a node gives out: "ROS_IP=192.168.1.7" or "ROS_HOSTNAME=robot".
std::string addressSetting(const std::string& host);

}  // namespace pmeta_nodes
