#pragma once

#include <pmeta_msgs/DescribeEnv.h>
#include <pmeta_msgs/ResetEnv.h>
#include <pmeta_msgs/StepEnv.h>
#include <ros/ros.h>

#include <cstdint>
#include <functional>
#include <limits>
#include <mutex>
#include <string>
#include <vector>

namespace pmeta_nodes {

/// A robot or simulator behind the services describe, reset and step, for one agent to train on.
///
/// An agent that has lost an answer asks again: every reset and step is done once, and its answer
/// kept. What `reset` and `act` throw becomes the answer's error, after which the episode is over.
class EnvServer {
 public:
  /// What a step gives.
  struct Result {
    std::vector<double> observation;  ///< after the step
    double reward = 0;                ///< of it
    bool terminated = false;          ///< a terminal state: nothing to come
    bool truncated = false;           ///< the episode ends for another reason
  };
  /// Begins an episode, whose randomness is to follow from `seed`, and gives its observation.
  using Reset = std::function<std::vector<double>(std::uint64_t seed)>;
  /// Acts once, and returns when that is done.
  using Act = std::function<Result(const std::vector<double>& action)>;

  /// Names, units and limits as DescribeEnv.srv says; see addObservation() and addAction().
  EnvServer(pmeta_msgs::DescribeEnv::Response description, Reset reset, Act act);

  /// Offers the services in the namespace of `node`, as long as this lives.
  void advertise(ros::NodeHandle& node);

  // the answers to requests, from any thread; never false

  /// Says what it is.
  bool describe(pmeta_msgs::DescribeEnv::Request& request,
                pmeta_msgs::DescribeEnv::Response& answer);
  /// Begins an episode, unless it did so when it was asked before.
  bool reset(pmeta_msgs::ResetEnv::Request& request, pmeta_msgs::ResetEnv::Response& answer);
  /// Acts, unless it did so when it was asked before.
  bool step(pmeta_msgs::StepEnv::Request& request, pmeta_msgs::StepEnv::Response& answer);

 private:
  std::string objectionTo(const std::vector<double>& action) const;
  bool isOfEpisode(std::uint64_t session, std::uint64_t episode) const;

  const pmeta_msgs::DescribeEnv::Response description_;
  const Reset reset_;
  const Act act_;
  std::vector<ros::ServiceServer> services_;
  std::mutex mutex_;           ///< guards what follows
  std::uint64_t session_ = 0;  ///< of the episode at hand, as are the two below
  std::uint64_t episode_ = 0;  ///< 0: there has been none
  std::uint32_t step_ = 0;     ///< made last
  bool over_ = true;           ///< is the episode at its end?
  pmeta_msgs::ResetEnv::Response start_;
  pmeta_msgs::StepEnv::Response last_;
};

/// Adds a number to the observations that `description` has.
void addObservation(pmeta_msgs::DescribeEnv::Response& description, const std::string& name,
                    const std::string& unit = "",
                    double low = -std::numeric_limits<double>::infinity(),
                    double high = std::numeric_limits<double>::infinity());

/// Adds a number to the actions; see DescribeEnv.srv.
void addAction(pmeta_msgs::DescribeEnv::Response& description, const std::string& name,
               const std::string& unit, double low, double high);

}  // namespace pmeta_nodes
