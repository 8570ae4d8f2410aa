// cart_pole_server: a cart-pole behind the services that pMeta trains on; one for each task.
//   rosrun pmeta_nodes cart_pole_server __ns:=/cart_pole_0 _force:=20
#include <pmeta_nodes/env_server.h>

#include <memory>

#include "pmeta_core/env/cart_pole.h"

using pmeta_nodes::EnvServer;

int main(int argc, char** argv) {
  ros::init(argc, argv, "cart_pole_server");
  ros::NodeHandle node;
  const ros::NodeHandle own("~");
  pmeta::CartPoleTask task;
  own.getParam("force", task.force_mag);
  own.getParam("masspole", task.masspole);
  own.getParam("length", task.length);
  pmeta::CartPole pole(task);
  std::unique_ptr<pmeta::Rng> rng;

  // names and units come from the simulator here; of a robot, write them down
  pmeta_msgs::DescribeEnv::Response description;
  for (const pmeta::Quantity& one : pole.spec().observation) {
    pmeta_nodes::addObservation(description, one.name, one.unit, one.low, one.high);
  }
  pmeta_nodes::addAction(description, "push", "", 0, 1);
  description.choices = {"left", "right"};
  description.step_seconds = pole.spec().step_seconds;

  const auto reset = [&](std::uint64_t seed) {
    rng = std::make_unique<pmeta::Rng>(seed, 0, pmeta::Stream::kCollect);
    std::vector<double> observation(4);
    pole.reset(*rng, observation.data());
    return observation;
  };
  const auto act = [&](const std::vector<double>& action) {
    EnvServer::Result result{std::vector<double>(4)};
    const pmeta::Step step = pole.step(action.data(), *rng, result.observation.data());
    result.reward = step.reward;
    result.terminated = step.terminated;
    result.truncated = step.truncated;
    return result;
  };
  EnvServer server(description, reset, act);
  server.advertise(node);
  ros::spin();
}
