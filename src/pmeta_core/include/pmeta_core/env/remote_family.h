#pragma once

#include <memory>
#include <string>
#include <vector>

#include "pmeta_core/env/remote_env.h"

namespace pmeta {

/// How long an agent has patience with a body in another process.
struct RemotePatience {
  double timeout = 5;         ///< s, for the answer to a step
  double reset_timeout = 60;  ///< s, for the answer to a reset
  int retries = 3;            ///< how often a step is asked for again
  double patience = 600;      ///< s, for a body that has gone to come back
};

/// Robots or simulators behind services, one for each task; the settings describe what all of them
/// observe and take, and whoever describes himself otherwise is refused.
class RemoteFamily : public EnvFamily {
 public:
  /// The way to the body whose services are below the namespace `ns`; all must outlive the link.
  using Connect = std::function<std::unique_ptr<RemoteLink>(
      const std::string& ns, const RemoteDescription& expected, const RemotePatience& patience,
      RemoteFigures& figures)>;

  /// How this program reaches bodies; empty unless it can. Nodes do, over ROS.
  static Connect& connector();

  void outline(const ListedSettings& given) override;
  void bind(Settings& settings) override;
  void build(std::uint64_t seed) override;
  int numTasks() const override { return static_cast<int>(servers_.size()); }
  int numTestTasks() const override { return static_cast<int>(test_servers_.size()); }
  std::string taskName(int task) const override;
  std::string taskDescription(int task) const override;
  /// Throws Error in a program that cannot reach bodies.
  std::unique_ptr<Env> create(int task) const override;
  bool hasOneBody() const override { return true; }
  std::vector<std::pair<std::string, std::string>> figures() const override;

  /// As the settings have it; after build().
  const RemoteDescription& description() const { return description_; }

 private:
  // a number of observation or action, as the settings have it
  struct Entry {
    std::string name;
    std::string unit;
    std::vector<double> limits;
  };
  using Entries = std::vector<Entry>;

  const std::string& serverOf(int task) const;

  std::vector<std::string> servers_;
  std::vector<std::string> test_servers_;
  Entries observations_;
  Entries actions_;
  RemoteDescription description_;
  RemotePace pace_;
  RemotePatience patience_;
  mutable RemoteFigures figures_;
};

}  // namespace pmeta
