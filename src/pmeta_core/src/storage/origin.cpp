#include "pmeta_core/storage/origin.h"

#include <nlohmann/json.hpp>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/format.h"
#include "pmeta_core/base/version.h"
#include "pmeta_core/nn/machine.h"
#include "pmeta_core/storage/run_lock.h"

namespace pmeta {
namespace {

using Texts = std::map<std::string, std::string>;

struct Origin {
  std::string host, commit;
  Texts machine, versions, settings;
};

Origin readOrigin(const std::string& origin) {
  try {
    const nlohmann::json json = nlohmann::json::parse(origin);
    return {json.at("host"), json.at("commit"), json.at("machine"), json.at("versions"),
            json.at("defining_settings")};
  } catch (const nlohmann::json::exception&) {
    throw Error("the run does not say with what it was launched: launch it with the same version.");
  }
}

std::string valueOf(const Texts& texts, const std::string& key) {
  const auto found = texts.find(key);
  return found == texts.end() ? "nothing" : shown(found->second);
}

}  // namespace

std::string originOf(const Experiment& experiment) {
  nlohmann::json origin;
  origin["host"] = hostName();
  origin["commit"] = commit();
  origin["machine"] = machine();
  origin["versions"] = versions();
  origin["defining_settings"] = experiment.definingSettings();
  return origin.dump();
}

OriginDifference differenceFrom(const std::string& origin, const Experiment& here) {
  const Origin there = readOrigin(origin);
  const std::string launched = ", but the run was launched on " + shown(there.host) + " with ";
  const std::string host = shown(hostName());
  OriginDifference difference;
  const Texts ours = versions();
  const std::string version = valueOf(there.versions, "pmeta");
  if (version != valueOf(ours, "pmeta")) {
    difference.refusal = host + " has pMeta " + valueOf(ours, "pmeta") + launched + version +
                         ": install the same version on both.";
    return difference;
  }
  const Texts settings = here.definingSettings();
  const std::string key = firstDifference(there.settings, settings);
  if (!key.empty()) {
    difference.refusal = host + " makes " + key + " " + valueOf(settings, key) + launched +
                         valueOf(there.settings, key) +
                         ": give both the same settings, and the same files that they name.";
    return difference;
  }
  if (there.commit != commit()) {
    difference.warnings.push_back(host + " has commit " + commit() + launched +
                                  plain(there.commit, 60) + ": the result may be another.");
  }
  const std::string mujoco = valueOf(there.versions, "mujoco");
  if (here.model() != nullptr && mujoco != valueOf(ours, "mujoco")) {
    difference.warnings.push_back(host + " has MuJoCo " + valueOf(ours, "mujoco") + launched +
                                  mujoco + ": the result may be another.");
  }
  const std::string part = differingPart(here, there.machine);
  if (!part.empty()) {
    difference.warnings.push_back(
        host + " is another kind of machine than " + shown(there.host) + ", which has " + part +
        ": the result may differ from that of one machine" +
        (here.settings().arithmetic == "native" ? "; arithmetic: portable makes it the same."
                                                : "."));
  }
  return difference;
}

std::string differingPart(const Experiment& experiment, const Texts& other) {
  // tables have no matrix products; portable ones are the same everywhere
  if (!experiment.hasNetworks()) return "";
  const bool portable = experiment.settings().arithmetic == "portable";
  const Texts now = machine();
  for (const std::string part : {"products", "processor", "glibc"}) {
    if (portable && part != "glibc") continue;
    const auto found = other.find(part);
    if (found == other.end() || found->second == now.at(part)) continue;
    return part + " " + shown(found->second) + ", here " + shown(now.at(part));
  }
  return "";
}

}  // namespace pmeta
