#include "policy/drive_robot.h"

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/names.h"

namespace pmeta_nodes {
namespace {

double now() { return ros::SteadyTime::now().toSec(); }

}  // namespace

DriveRobot::DriveRobot(pmeta::RobotDriver& driver, const std::vector<std::string>& single_inputs)
    : driver_(driver) {
  const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
  for (const std::string& name : driver.outputs()) {
    std_msgs::MultiArrayDimension dimension;
    dimension.label = name;
    dimension.size = dimension.stride = 1;
    command_.layout.dim.push_back(dimension);
  }
  command_pub_ = nh_.advertise<std_msgs::Float64MultiArray>("command", 1);
  joints_sub_ = nh_.subscribe("joint_states", 1, &DriveRobot::onJoints, this, hints);
  for (const std::string& name : single_inputs) {
    input_subs_.push_back(nh_.subscribe<std_msgs::Float64>(
        "input/" + name, 1,
        [this, name](const std_msgs::Float64::ConstPtr& msg) {
          taken([&] { driver_.take(name, msg->data, now()); });
        },
        ros::VoidConstPtr(), hints));
  }
  if (driver.policy().observes()) {
    input_subs_.push_back(nh_.subscribe<std_msgs::Float64>(
        "reward", 1,
        [this](const std_msgs::Float64::ConstPtr& msg) { driver_.takeReward(msg->data); },
        ros::VoidConstPtr(), hints));
    services_.push_back(nh_.advertiseService("begin_episode", &DriveRobot::onBeginEpisode, this));
  }
  services_.push_back(nh_.advertiseService("arm", &DriveRobot::onArm, this));
  const std::string description = driver.policy().description();
  health_ = std::make_unique<Health>(description, "driver", [this] { return health(); });
  timer_ = nh_.createSteadyTimer(ros::WallDuration(driver.period()), &DriveRobot::onTimer, this);
  ROS_INFO("driving with the %s: %s, %g times a second; disarmed until %s is called",
           description.c_str(), pmeta::join(driver.outputs()).c_str(), 1 / driver.period(),
           services_.back().getService().c_str());
}

DriveRobot::~DriveRobot() {
  timer_.stop();
  driver_.disarm();
  publishCommand();
}

// counts what is refused, and says why
template <class Take>
void DriveRobot::taken(const Take& take) {
  try {
    take();
  } catch (const pmeta::Error& error) {
    ++refused_;
    ROS_WARN_THROTTLE(5, "refused an input: %s", error.what());
  }
}

void DriveRobot::onJoints(const sensor_msgs::JointState& joints) {
  taken([&] {
    driver_.take({joints.name, joints.position, joints.velocity, joints.effort}, now());
  });
}

bool DriveRobot::onArm(std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response) {
  request.data != 0 ? driver_.arm() : driver_.disarm();
  response.success = 1;
  response.message = driver_.armed() ? "armed" : "disarmed";
  ROS_INFO("%s", response.message.c_str());
  return true;
}

bool DriveRobot::onBeginEpisode(std_srvs::Trigger::Request&,
                                std_srvs::Trigger::Response& response) {
  driver_.beginEpisode();
  response.success = 1;
  response.message = driver_.policy().exploring()
                         ? "exploring, episode " + std::to_string(driver_.policy().episode()) +
                               " of " + std::to_string(driver_.policy().explorationEpisodes())
                         : "acting";
  ROS_INFO("%s", response.message.c_str());
  return true;
}

void DriveRobot::onTimer(const ros::SteadyTimerEvent& event) {
  const double late = (event.current_real - event.current_expected).toSec();
  if (late > driver_.period()) ++late_;
  publishCommand();
}

void DriveRobot::publishCommand() {
  const std::string before = driver_.reason();
  command_.data = driver_.command(now());
  command_pub_.publish(command_);
  ++commands_;
  const std::string& reason = driver_.reason();
  if (reason.empty()) ++acted_;
  if (driver_.armed() && !reason.empty() && before.empty()) {
    ROS_WARN_THROTTLE(1, "the safe action: %s", reason.c_str());
  }
}

HealthReport DriveRobot::health() const {
  HealthReport report;
  const std::string& reason = driver_.reason();
  report.level = driver_.armed() && !reason.empty() ? HealthReport::kWarn : HealthReport::kOk;
  report.summary = reason.empty() ? "the policy acts" : "safe action: " + reason;
  report.values = {{"commands", std::to_string(commands_)},
                   {"of the policy", std::to_string(acted_)},
                   {"late by more than a period", std::to_string(late_)},
                   {"refused inputs", std::to_string(refused_)}};
  return report;
}

}  // namespace pmeta_nodes
