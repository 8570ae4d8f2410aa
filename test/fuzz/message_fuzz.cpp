#include <pmeta_msgs/AuxiliaryUpdate.h>
#include <pmeta_msgs/MetaPolicy.h>
#include <pmeta_msgs/TaskReturn.h>
#include <ros/serialization.h>

#include <cmath>
#include <memory>
#include <new>

#include "conversions.h"
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
  std::vector<std::uint8_t> buffer(bytes.begin(), bytes.end());
  const auto size = static_cast<std::uint32_t>(buffer.size());
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

void offer(const pmeta_msgs::AuxiliaryUpdate& msg) {
  const auto update = std::make_shared<const AuxiliaryUpdate>(pmeta_nodes::fromMsg(msg));
  require(pmeta_nodes::fromMsg(pmeta_nodes::toMsg(update->model)) == update->model,
          "a model changes on its way");
  MetaAggregator aggregator(experiment());
  if (aggregator.offer(update).verdict != MetaAggregator::Verdict::kAccepted) return;
  require(aggregator.offer(update).verdict == MetaAggregator::Verdict::kDuplicate,
          "an update is accepted twice");
  aggregator.closeRound();
  requireFinite(aggregator.metaPolicy().model);
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
  try {
    if ((type == 'a' || type == 'A') && read<pmeta_msgs::AuxiliaryUpdate_>(bytes, update)) {
      if (type == 'A') mend(update.model);
      offer(update);
    } else if ((type == 'm' || type == 'M') && read<pmeta_msgs::MetaPolicy_>(bytes, meta)) {
      if (type == 'M') mend(meta.model);
      const MetaPolicy back = pmeta_nodes::fromMsg(meta);
      require(
          back.model.byteCount() / (back.model.layout.precision() == Precision::kFloat32 ? 4 : 8) ==
              back.model.size(),
          "a model is of another size than its layout");
      checkModel(back.model, back.model.layout, "the aggregator");
    } else if (type == 'r' && read<pmeta_msgs::TaskReturn_>(bytes, result)) {
      const TaskReturn back = pmeta_nodes::fromMsg(result);
      const auto again = pmeta_nodes::toMsg(back, result.task_name);
      require(again.task == result.task && again.round == result.round, "a return changes");
    }
  } catch (const Error&) {
  }
}

}  // namespace pmeta::fuzz
