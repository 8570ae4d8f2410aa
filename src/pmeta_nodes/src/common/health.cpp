#include "common/health.h"

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/ros.h>

namespace pmeta_nodes {

struct Health::Impl {
  diagnostic_updater::Updater updater;
  ros::WallTimer timer;
};

Health::Health(const std::string& hardware_id, const std::string& name,
               std::function<HealthReport()> report)
    : impl_(std::make_unique<Impl>()) {
  impl_->updater.setHardwareID(hardware_id);
  impl_->updater.add(name, [report](diagnostic_updater::DiagnosticStatusWrapper& status) {
    const HealthReport now = report();
    status.summary(static_cast<unsigned char>(now.level), now.summary);
    for (const auto& value : now.values) status.add(value.first, value.second);
  });
  impl_->timer = ros::NodeHandle().createWallTimer(
      ros::WallDuration(1.0), [this](const ros::WallTimerEvent&) { impl_->updater.update(); });
}

Health::~Health() = default;

}  // namespace pmeta_nodes
