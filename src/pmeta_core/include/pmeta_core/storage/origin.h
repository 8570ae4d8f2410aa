#pragma once

#include <map>
#include <string>
#include <vector>

#include "pmeta_core/experiment/experiment.h"

namespace pmeta {

/// Where and with what a run was launched, as one line of JSON: its settings, and the machine,
/// version and commit. Agents that are started on other machines are compared with it.
std::string originOf(const Experiment& experiment);

/// What sets this machine apart from the one where a run was launched, in sentences that name both.
struct OriginDifference {
  std::string refusal;                ///< why its agents cannot take part; "" if they can
  std::vector<std::string> warnings;  ///< why its numbers may be others
};

/// Compares this machine with an originOf(); `here` is the experiment as it is read here, of the
/// same settings. Throws Error if `origin` is none.
OriginDifference differenceFrom(const std::string& origin, const Experiment& here);

/// The first part of another machine(), "products AVX2, here AVX512", that changes this
/// experiment's numbers; "" if none does.
std::string differingPart(const Experiment& experiment,
                          const std::map<std::string, std::string>& other);

}  // namespace pmeta
