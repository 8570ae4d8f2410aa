#include "pmeta_nodes/env_server.h"

#include <exception>
#include <utility>

namespace pmeta_nodes {

EnvServer::EnvServer(pmeta_msgs::DescribeEnv::Response description, Reset reset, Act act)
    : description_(std::move(description)), reset_(std::move(reset)), act_(std::move(act)) {}

void EnvServer::advertise(ros::NodeHandle& node) {
  services_ = {node.advertiseService("describe", &EnvServer::describe, this),
               node.advertiseService("reset", &EnvServer::reset, this),
               node.advertiseService("step", &EnvServer::step, this)};
}

bool EnvServer::describe(pmeta_msgs::DescribeEnv::Request&,
                         pmeta_msgs::DescribeEnv::Response& answer) {
  answer = description_;
  return true;
}

bool EnvServer::isOfEpisode(std::uint64_t session, std::uint64_t episode) const {
  return episode_ > 0 && session == session_ && episode == episode_;
}

bool EnvServer::reset(pmeta_msgs::ResetEnv::Request& request,
                      pmeta_msgs::ResetEnv::Response& answer) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (request.session == session_ && request.episode < episode_) {
    answer.error = "episode " + std::to_string(request.episode) + " is over: episode " +
                   std::to_string(episode_) + " has begun.";
    return true;
  }
  if (!isOfEpisode(request.session, request.episode)) {
    session_ = request.session;
    episode_ = request.episode;
    step_ = 0;
    over_ = false;
    start_ = {};
    try {
      start_.observation = reset_(request.seed);
    } catch (const std::exception& error) {
      over_ = true;
      start_.error = error.what();
    }
  }
  answer = start_;
  return true;
}

// a robot must not be given what it was not meant to take
std::string EnvServer::objectionTo(const std::vector<double>& action) const {
  const std::size_t size = description_.action_names.size();
  if (action.size() != size) {
    return "an action of " + std::to_string(action.size()) + " numbers is not one of " +
           std::to_string(size) + ".";
  }
  for (std::size_t i = 0; i < size; ++i) {
    if (action[i] >= description_.action_low[i] && action[i] <= description_.action_high[i]) {
      continue;
    }
    return description_.action_names[i] + " of an action is " + std::to_string(action[i]) +
           ", which is out of its limits.";
  }
  return "";
}

bool EnvServer::step(pmeta_msgs::StepEnv::Request& request, pmeta_msgs::StepEnv::Response& answer) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!isOfEpisode(request.session, request.episode)) {
    answer.error =
        "there is no such episode: it was begun before this server was, or another "
        "agent has begun one since.";
    return true;
  }
  if (request.step != step_ || step_ == 0) {
    if (over_ || request.step != step_ + 1) {
      answer.error = "step " + std::to_string(request.step) + " cannot be made after step " +
                     std::to_string(step_) + (over_ ? ", which ended the episode." : ".");
      return true;
    }
    answer.error = objectionTo(request.action);
    if (!answer.error.empty()) return true;
    step_ = request.step;
    last_ = {};
    try {
      Result result = act_(request.action);
      last_.observation = std::move(result.observation);
      last_.reward = result.reward;
      last_.terminated = result.terminated;
      last_.truncated = result.truncated;
      over_ = result.terminated || result.truncated;
    } catch (const std::exception& error) {
      over_ = true;
      last_.error = error.what();
    }
  }
  answer = last_;
  return true;
}

void addObservation(pmeta_msgs::DescribeEnv::Response& description, const std::string& name,
                    const std::string& unit, double low, double high) {
  description.observation_names.push_back(name);
  description.observation_units.push_back(unit);
  description.observation_low.push_back(low);
  description.observation_high.push_back(high);
}

void addAction(pmeta_msgs::DescribeEnv::Response& description, const std::string& name,
               const std::string& unit, double low, double high) {
  description.action_names.push_back(name);
  description.action_units.push_back(unit);
  description.action_low.push_back(low);
  description.action_high.push_back(high);
}

}  // namespace pmeta_nodes
