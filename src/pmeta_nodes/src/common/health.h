#pragma once

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace pmeta_nodes {

/// What a node reports to /diagnostics.
struct HealthReport {
  enum Level { kOk, kWarn, kError };
  Level level = kOk;
  std::string summary;
  std::vector<std::pair<std::string, std::string>> values;
};

/// Publishes a report to /diagnostics once a second, from the thread that spins.
/// Keeps diagnostic_updater's heavy headers out of the nodes.
class Health {
 public:
  Health(const std::string& hardware_id, const std::string& name,
         std::function<HealthReport()> report);
  ~Health();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace pmeta_nodes
