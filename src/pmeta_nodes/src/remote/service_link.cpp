#include "remote/service_link.h"

#include <random>
#include <thread>

#include "common/run_node.h"
#include "pmeta_core/base/format.h"
#include "pmeta_core/base/process.h"

namespace pmeta_nodes {
namespace {

using Clock = std::chrono::steady_clock;

constexpr auto kAskAgain = std::chrono::milliseconds(200);
constexpr double kTellAgain = 10;  // s
constexpr std::size_t kMostOfAnError = 200;

// nodes reach bodies by ROS's services
const bool kConnected = [] {
  pmeta::RemoteFamily::connector() =
      [](const std::string& ns, const pmeta::RemoteDescription& expected,
         const pmeta::RemotePatience& patience, pmeta::RemoteFigures& figures) {
        return std::make_unique<ServiceLink>(ns, expected, patience, figures);
      };
  return true;
}();

// two agents that ask one server must not take each other's answers for their own
std::uint64_t drawSession() {
  std::random_device device;
  return (static_cast<std::uint64_t>(device()) << 32) | device();
}

// what a server has to say, as the end of a clause
std::string clause(const std::string& error) {
  std::string text = pmeta::plain(error, kMostOfAnError);
  if (!text.empty() && text.back() == '.') text.pop_back();
  return text;
}

std::vector<pmeta::Quantity> quantities(const std::string& what, const std::string& ns,
                                        const std::vector<std::string>& names,
                                        const std::vector<std::string>& units,
                                        const std::vector<double>& low,
                                        const std::vector<double>& high) {
  if (units.size() != names.size() || low.size() != names.size() || high.size() != names.size()) {
    throw pmeta::LostEnvironment(ns + "/describe names " + std::to_string(names.size()) +
                                 " numbers of an " + what +
                                 " but has other numbers of units or limits: mend the server.");
  }
  std::vector<pmeta::Quantity> all;
  for (std::size_t i = 0; i < names.size(); ++i) {
    all.push_back({names[i], units[i], low[i], high[i]});
  }
  return all;
}

}  // namespace

pmeta::RemoteDescription fromMsg(const pmeta_msgs::DescribeEnv::Response& msg,
                                 const std::string& ns) {
  pmeta::RemoteDescription told;
  told.observation = quantities("observation", ns, msg.observation_names, msg.observation_units,
                                msg.observation_low, msg.observation_high);
  told.action =
      quantities("action", ns, msg.action_names, msg.action_units, msg.action_low, msg.action_high);
  told.choices = msg.choices;
  told.horizon = static_cast<int>(msg.horizon);
  told.step_seconds = msg.step_seconds;
  return told;
}

ServiceLink::ServiceLink(const std::string& ns, const pmeta::RemoteDescription& expected,
                         const pmeta::RemotePatience& patience, pmeta::RemoteFigures& figures)
    : ns_(ns),
      expected_(expected),
      patience_(patience),
      figures_(figures),
      session_(drawSession()) {}

// once; false where there is no answer
template <class Service>
bool ServiceLink::ask(const std::string& name, ros::ServiceClient& client, Service& service,
                      double seconds) {
  if (stopRequested()) throw pmeta::Interrupted();
  if (!client.isValid()) {
    client = nh_.serviceClient<Service>(ns_ + "/" + name, true);
    if (client.isValid()) ++figures_.connections;
  }
  if (client.isValid() && watch_.call(client, service, seconds)) return true;
  described_ = false;
  client.shutdown();
  if (stopRequested()) throw pmeta::Interrupted();
  std::this_thread::sleep_for(kAskAgain);
  return false;
}

bool ServiceLink::isAsExpected() {
  if (described_) return true;
  pmeta_msgs::DescribeEnv service;
  if (!ask("describe", describe_, service, patience_.timeout)) return false;
  const std::string found = pmeta::difference(expected_, fromMsg(service.response, ns_));
  if (!found.empty()) {
    throw pmeta::LostEnvironment(ns_ + " is not what the settings say: " + found +
                                 "; mend its server or environment in the settings.");
  }
  described_ = true;
  return true;
}

bool ServiceLink::tryReset(pmeta_msgs::ResetEnv& service) {
  return isAsExpected() && ask("reset", reset_, service, patience_.reset_timeout);
}

std::vector<double> ServiceLink::reset(std::uint64_t episode, std::uint64_t seed) {
  pmeta_msgs::ResetEnv service;
  service.request.session = session_;
  service.request.episode = episode;
  service.request.seed = seed;
  const Clock::time_point start = Clock::now();
  double told = 0;
  while (!tryReset(service)) {
    const double waited = std::chrono::duration<double>(Clock::now() - start).count();
    if (waited > patience_.patience) {
      throw pmeta::LostEnvironment("the services of " + ns_ + " have not answered for " +
                                   pmeta::shortNumber(waited) +
                                   " s: start their server, then go on with the run.");
    }
    if (told > 0 && waited < told + kTellAgain) continue;
    told = waited;
    ROS_WARN("waiting for the services of %s: no answer for %.0f of %.0f s.", ns_.c_str(), waited,
             patience_.patience);
  }
  if (told > 0) ROS_INFO("the services of %s answer again.", ns_.c_str());
  if (service.response.error.empty()) return service.response.observation;
  throw pmeta::BrokenEpisode(ns_ + " has not begun an episode: " + clause(service.response.error));
}

pmeta::RemoteAnswer ServiceLink::step(std::uint64_t episode, std::uint32_t step,
                                      const std::vector<double>& action) {
  pmeta_msgs::StepEnv service;
  service.request.session = session_;
  service.request.episode = episode;
  service.request.step = step;
  service.request.action = action;
  for (int tries = 1; !ask("step", step_, service, patience_.timeout); ++tries) {
    if (tries <= patience_.retries) continue;
    throw pmeta::BrokenEpisode(ns_ + "/step has not answered step " + std::to_string(step) +
                               " of an episode, asked for " + std::to_string(tries) + " times");
  }
  const pmeta_msgs::StepEnv::Response& answer = service.response;
  if (!answer.error.empty()) {
    throw pmeta::BrokenEpisode(ns_ + " has not made step " + std::to_string(step) +
                               " of an episode: " + clause(answer.error));
  }
  return {answer.observation, answer.reward, answer.terminated != 0, answer.truncated != 0};
}

void ServiceLink::warn(const std::string& sentence) { ROS_WARN("%s", sentence.c_str()); }

}  // namespace pmeta_nodes
