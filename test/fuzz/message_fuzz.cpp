#include <pmeta_msgs/AuxiliaryUpdate.h>
#include <pmeta_msgs/MetaPolicy.h>
#include <pmeta_msgs/RoundSummary.h>
#include <pmeta_msgs/TaskReturn.h>
#include <ros/serialization.h>

#include <cmath>
#include <memory>
#include <new>

#include "common/conversions.h"
#include "fuzz_support.h"
#include "pmeta_core/base/error.h"
#include "pmeta_core/run/meta_aggregator.h"
#include "targets.h"

namespace pmeta::fuzz {
namespace {

namespace ser = ros::serialization;

constexpr std::size_t kMostBytes = 1 << 20;

// roscpp makes an array as long as a message claims it to be before it looks for the elements;
// here such claims are an error rather than gigabytes
template <class T>
struct Bounded {
  using value_type = T;
  Bounded() = default;
  template <class U>
  Bounded(const Bounded<U>&) {}
  template <class U>
  struct rebind {
    using other = Bounded<U>;
  };
  T* allocate(std::size_t n) {
    if (n > kMostBytes / sizeof(T)) throw std::bad_alloc();
    return std::allocator<T>().allocate(n);
  }
  void deallocate(T* p, std::size_t n) { std::allocator<T>().deallocate(p, n); }
  bool operator==(const Bounded&) const { return true; }
  bool operator!=(const Bounded&) const { return false; }
};

template <template <class> class Msg>
bool read(const std::string& bytes, Msg<std::allocator<void>>& msg) {
  const auto size = static_cast<std::uint32_t>(bytes.size());
  std::vector<std::uint8_t> buffer(bytes.begin(), bytes.end());
  buffer.push_back(0);  // roscpp counts on from where the message begins: not from null
  try {
    Msg<Bounded<void>> probe;
    ser::IStream first(buffer.data(), size);
    ser::deserialize(first, probe);
    ser::IStream second(buffer.data(), size);
    ser::deserialize(second, msg);
  } catch (const ser::StreamOverrunException&) {
    return false;
  } catch (const std::bad_alloc&) {
    return false;
  }
  return true;
}

// gives a changed model the hash and the checksum that its contents have
void mend(pmeta_msgs::ModelBlob& blob) {
  const ModelLayout layout = ModelLayout::parse(blob.layout);
  Model model;
  if (layout.precision() == Precision::kFloat32) {
    model.values = blob.float32_values;
  } else {
    model.values = blob.float64_values;
  }
  model.present = blob.present;
  blob.layout_hash = layout.hash();
  blob.checksum = model.checksum();
}

void requireFinite(const Model& model) {
  std::visit(
      [](const auto& values) {
        for (const auto value : values) require(std::isfinite(value), "a meta-policy not finite");
      },
      model.values);
}

const Experiment& experiment() {
  static const Experiment kExperiment = Experiment::parse(R"(
run_id: run
results_dir: /tmp/pmeta_unused
rounds: 3
personal: {alpha: 0.1, lambda: 1, eta: 0.1}
environment: {name: gridworld, sizes: [2, 3], landmark: corner}
)",
                                                          "fuzz.yaml");
  return kExperiment;
}

// the corpus, which outlives changes of the settings, has "right" for their hash
void offer(const pmeta_msgs::AuxiliaryUpdate& msg) {
  const auto update = std::make_shared<AuxiliaryUpdate>(pmeta_nodes::fromMsg(msg));
  if (update->settings_hash == "right") update->settings_hash = experiment().settingsHash();
  require(pmeta_nodes::fromMsg(pmeta_nodes::toMsg(update->model)) == update->model,
          "a model changes on its way");
  MetaAggregator aggregator(experiment());
  if (aggregator.offer(update).verdict != MetaAggregator::Verdict::kAccepted) return;
  require(aggregator.offer(update).verdict == MetaAggregator::Verdict::kDuplicate,
          "an update is accepted twice");
  aggregator.closeRound();
  requireFinite(aggregator.metaPolicy().model);
}

void take(const pmeta_msgs::MetaPolicy& msg) {
  const MetaPolicy meta = pmeta_nodes::fromMsg(msg);
  const std::size_t scalar = meta.model.layout.precision() == Precision::kFloat32 ? 4 : 8;
  require(meta.model.byteCount() == meta.model.size() * scalar,
          "a model is of another size than its layout");
  checkModel(meta.model, meta.model.layout, "the aggregator");
}

// nobody without the key signs, and what is signed with it is taken
template <class Msg>
void checkMac(Msg msg) {
  static const Authenticator kAuthenticator{Key{1, 2, 3}};
  require(pmeta_nodes::authenticate(kAuthenticator, msg) != Authenticity::kAuthentic,
          "a MAC is forged");
  pmeta_nodes::sign(kAuthenticator, msg);
  require(pmeta_nodes::authenticate(kAuthenticator, msg) == Authenticity::kAuthentic,
          "a MAC of our own is not recognised");
}

}  // namespace

// a letter that says the type, then a message as it comes over the wire; of a capital letter's
// message the model is mended, as whoever means harm would
void fuzzMessage(const std::uint8_t* data, std::size_t size) {
  std::string bytes = textOf(data, size);
  if (bytes.empty()) return;
  const char type = bytes[0];
  bytes.erase(0, 1);
  pmeta_msgs::AuxiliaryUpdate update;
  pmeta_msgs::MetaPolicy meta;
  pmeta_msgs::TaskReturn result;
  pmeta_msgs::RoundSummary summary;
  try {
    if ((type == 'a' || type == 'A') && read<pmeta_msgs::AuxiliaryUpdate_>(bytes, update)) {
      if (type == 'A') mend(update.model);
      checkMac(update);
      offer(update);
    } else if ((type == 'm' || type == 'M') && read<pmeta_msgs::MetaPolicy_>(bytes, meta)) {
      if (type == 'M') mend(meta.model);
      checkMac(meta);
      take(meta);
    } else if (type == 'r' && read<pmeta_msgs::TaskReturn_>(bytes, result)) {
      checkMac(result);
      const auto again = pmeta_nodes::toMsg(pmeta_nodes::fromMsg(result), result.task_name);
      require(again.task == result.task && again.round == result.round, "a return changes");
    } else if (type == 's' && read<pmeta_msgs::RoundSummary_>(bytes, summary)) {
      checkMac(summary);
      const auto again = pmeta_nodes::toMsg(pmeta_nodes::fromMsg(summary), experiment());
      require(again.round == summary.round && again.missing == summary.missing,
              "a summary changes");
    }
  } catch (const Error&) {
  }
}

}  // namespace pmeta::fuzz
