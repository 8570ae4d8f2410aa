#pragma once

#include <pmeta_msgs/DescribeEnv.h>
#include <pmeta_msgs/ResetEnv.h>
#include <pmeta_msgs/StepEnv.h>
#include <ros/ros.h>

#include <cstdint>
#include <string>
#include <vector>

#include "pmeta_core/env/remote_family.h"
#include "remote/call_watch.h"

namespace pmeta_nodes {

/// The way to a robot or simulator by the services of pmeta_msgs, over connections that stay.
///
/// An answer that does not come in time is asked for again by the same numbers, over a new
/// connection: whoever serves does each step once. Who comes back after a loss is asked for its
/// description again.
class ServiceLink : public pmeta::RemoteLink {
 public:
  /// `ns`: of the services. What is referred to must outlive the link.
  ServiceLink(const std::string& ns, const pmeta::RemoteDescription& expected,
              const pmeta::RemotePatience& patience, pmeta::RemoteFigures& figures);

  std::vector<double> reset(std::uint64_t episode, std::uint64_t seed) override;
  pmeta::RemoteAnswer step(std::uint64_t episode, std::uint32_t step,
                           const std::vector<double>& action) override;
  void warn(const std::string& sentence) override;

 private:
  template <class Service>
  bool ask(const std::string& name, ros::ServiceClient& client, Service& service, double seconds);
  bool isAsExpected();
  bool tryReset(pmeta_msgs::ResetEnv& service);

  const std::string ns_;
  const pmeta::RemoteDescription& expected_;
  const pmeta::RemotePatience& patience_;
  pmeta::RemoteFigures& figures_;
  const std::uint64_t session_;
  ros::NodeHandle nh_;
  ros::ServiceClient describe_, reset_, step_;
  bool described_ = false;  ///< since the last loss
  CallWatch watch_;
};

/// As the message has it. Throws LostEnvironment where its arrays are not of one length; `ns`:
/// whose it is.
pmeta::RemoteDescription fromMsg(const pmeta_msgs::DescribeEnv::Response& msg,
                                 const std::string& ns);

}  // namespace pmeta_nodes
