// Does an exported model act as the policy that it was made of?
//
//   onnx_act POLICY_FILE MODEL [TASK [told]]
//
// Both answer 100 observations, as for TASK, which is also the second input of a model that is to
// be told it. Prints the largest difference of their actions, and of discrete ones how many differ.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <opencv2/dnn.hpp>
#include <stdexcept>
#include <vector>

#include "pmeta_core/run/loaded_policy.h"

namespace {

struct Answers {
  double largest = 0;  // difference of an action's number
  int other = 0;       // best action
};

void compare(const cv::Mat& output, bool discrete, const std::vector<double>& action,
             Answers& answers) {
  const float* found = output.ptr<float>();
  if (discrete) {
    answers.other += found[0] != static_cast<float>(action[0]);
    return;
  }
  for (std::size_t j = 0; j < action.size(); ++j) {
    answers.largest = std::max(answers.largest, std::abs(found[j] - action[j]));
  }
}

Answers act(pmeta::LoadedPolicy& policy, cv::dnn::Net& net, bool told) {
  const auto observations = static_cast<std::size_t>(policy.spec().observation_size);
  const bool discrete = policy.spec().num_actions > 0;
  std::vector<double> observation(observations);
  std::vector<double> action(static_cast<std::size_t>(policy.spec().action_size));
  pmeta::Rng rng(1, 0, pmeta::Stream::kMeasure);
  Answers answers;
  for (int k = 0; k < 100; ++k) {
    cv::Mat input(1, static_cast<int>(observations), CV_32F);
    for (std::size_t i = 0; i < observations; ++i) {
      observation[i] = input.at<float>(static_cast<int>(i)) = static_cast<float>(rng.normal());
    }
    if (!policy.act(observation.data(), action.data())) throw std::runtime_error("no action");
    net.setInput(input, "observation");
    if (told) net.setInput(cv::Mat(policy.taskInput(), true).reshape(1, 1), "task_input");
    compare(net.forward("action"), discrete, action, answers);
  }
  return answers;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    if (argc < 3) throw std::runtime_error("usage: onnx_act POLICY_FILE MODEL [TASK [told]]");
    pmeta::LoadedPolicy policy(argv[1], argc > 3 ? std::atoi(argv[3]) : -1);
    cv::dnn::Net net = cv::dnn::readNetFromONNX(argv[2]);
    const Answers answers = act(policy, net, argc > 4);
    std::printf("%.9g %d\n", answers.largest, answers.other);
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "onnx_act: %s\n", error.what());
    return 1;
  }
}
