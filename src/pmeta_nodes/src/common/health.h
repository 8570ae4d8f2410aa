#pragma once

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace pmeta_nodes {

/// What a node reports to /diagnostics.
struct HealthReport {
  /// As diagnostic_msgs/DiagnosticStatus has them.
  enum Level { kOk, kWarn, kError };
  Level level = kOk;                                        ///< the worst that is true
  std::string summary;                                      ///< a clause
  std::vector<std::pair<std::string, std::string>> values;  ///< by name, as they are shown
};

/// Publishes a report to /diagnostics once a second, from the thread that spins.
/// Keeps diagnostic_updater's heavy headers out of the nodes.
class Health {
 public:
  /// `report` is called from the thread that spins, as long as this lives.
  Health(const std::string& hardware_id, const std::string& name,
         std::function<HealthReport()> report);
  ~Health();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace pmeta_nodes
