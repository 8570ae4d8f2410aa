#include "pmeta_core/mjcf/mjcf_family.h"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>

#include "pmeta_core/base/error.h"
#include "pmeta_core/env/model_files.h"
#include "pmeta_core/env/task_split.h"
#include "pmeta_core/env/task_values.h"
#include "pmeta_core/mjcf/mjcf_env.h"

namespace pmeta {
namespace {

const RegisteredFamily<MjcfFamily> kFamily(kMjcf);

using Variation = Section<VariationTerm, VariationCommon>::Entry;

std::string keyOf(const Variation& variation) { return "environment.variations." + variation.name; }

void check(const Variation& variation) {
  const VariationCommon& v = variation.common;
  const std::string key = keyOf(variation);
  if (v.values.empty() && v.range.empty()) {
    throw Error(key + " has neither values nor a range: give one of them.");
  }
  if (!v.range.empty() && (v.range.size() != 2 || v.range[0] > v.range[1])) {
    throw Error(key + ".range must be [low, high].");
  }
  if (v.distribution == "log_uniform" && !v.range.empty() && v.range[0] <= 0) {
    throw Error(key + ".range begins at " + formatNumber(v.range[0]) +
                " but must be above 0 where the distribution is log_uniform.");
  }
  if (v.independent && !(v.values.empty() && v.test_values.empty())) {
    throw Error(key + " is independent, for which its numbers are drawn: leave out its values.");
  }
}

/// How many tasks there are of a split; `given`: as the settings say.
int countTasks(const MjcfDesign& design, bool test, int given) {
  std::size_t longest = 0;
  for (const Variation& variation : design.variations.entries()) {
    longest =
        std::max(longest, (test ? variation.common.test_values : variation.common.values).size());
  }
  if (given > 0) return given;
  if (longest > 0 || test) return static_cast<int>(longest);
  if (design.variations.entries().empty()) return 1;
  throw Error(
      "environment.train_tasks is 0 but the variations are drawn: say how many tasks there "
      "are.");
}

double drawn(const VariationCommon& variation, Rng& rng) {
  const double low = variation.range[0];
  const double high = variation.range[1];
  if (variation.distribution == "uniform") return low + (high - low) * rng.uniform();
  return low * std::pow(high / low, rng.uniform());
}

double changed(double before, const VariationCommon& variation, double by) {
  if (variation.operation == "scale") return before * by;
  return variation.operation == "add" ? before + by : by;
}

/// One variation of one task; gives what a person would call it.
std::string apply(const Variation& variation, const std::vector<double>& values, int task, Rng& rng,
                  TaskDraft& draft) {
  const VariationCommon& v = variation.common;
  std::vector<Figure> figures = variation.term->figures(draft);
  double value = 0;
  if (!v.independent) {
    value = values.empty() ? drawn(v, rng) : taskValue(values, static_cast<std::size_t>(task));
  }
  for (Figure& figure : figures) {
    const double by = v.independent ? drawn(v, rng) : value;
    const double now = changed(figure.value, v, by);
    if (!(now >= figure.least)) {
      throw Error(keyOf(variation) + " makes a number " + formatNumber(now) +
                  " but it must be at least " + formatNumber(figure.least) + ".");
    }
    figure.set(now);
  }
  if (v.independent) return variation.name + " drawn";
  return variation.name + " " + formatNumber(value);
}

// what MuJoCo derives from masses and lengths when it compiles a model
void recompute(MujocoModel& model) {
  const std::unique_ptr<mjData, void (*)(mjData*)> data(mj_makeData(model.get()), mj_deleteData);
  if (data == nullptr) throw Error("MuJoCo cannot simulate the model " + model.source() + ".");
  mj_setConst(model.get(), data.get());
}

}  // namespace

void MjcfFamily::outline(const ListedSettings& given) {
  given_ = given;
  design_.outline(given);
}

void MjcfFamily::build(std::uint64_t seed) {
  if (design_.model.file.empty()) {
    throw Error("environment.model_file must name the robot: an MJCF or URDF file.");
  }
  base_ = std::make_shared<const MujocoModel>(MujocoModel::load(design_.model.file));
  design_.model.take(ModelFiles::find(design_.model.file).hash, base_->source());
  design_.find(*base_);
  for (const Variation& variation : design_.variations.entries()) check(variation);
  num_train_ = countTasks(design_, false, design_.train_tasks);
  const int num_test = countTasks(design_, true, design_.test_tasks);
  for (const Variation& variation : design_.variations.entries()) {
    const VariationCommon& v = variation.common;
    if (!v.values.empty()) {
      requireTaskValues(keyOf(variation) + ".values", v.values,
                        static_cast<std::size_t>(num_train_));
    }
    if (!v.test_values.empty()) {
      requireTaskValues(keyOf(variation) + ".test_values", v.test_values,
                        static_cast<std::size_t>(num_test));
    } else if (num_test > 0 && v.range.empty()) {
      throw Error(keyOf(variation) + " has no test_values, and no range, for " +
                  std::to_string(num_test) + " test tasks: give one of them.");
    }
  }
  tasks_.clear();
  Settings settings;
  design_.bind(settings);
  for (int task = 0; task < num_train_ + num_test; ++task) {
    tasks_.push_back(drawTask(task, settings, seed));
  }
  make(0);  // says now what is wrong with names
}

MjcfFamily::Task MjcfFamily::drawTask(int task, const Settings& settings,
                                      std::uint64_t seed) const {
  const bool test = task >= num_train_;
  const int number = test ? task - num_train_ : task;
  Rng rng(seed, static_cast<std::uint64_t>(number),
          test ? Stream::kTestTaskDraw : Stream::kTaskDraw);
  MujocoModel model = base_->copy();
  TaskDraft draft{model.get(), &settings};
  std::vector<std::string> words;
  bool changes_model = false;
  for (const Variation& variation : design_.variations.entries()) {
    const VariationCommon& v = variation.common;
    words.push_back(apply(variation, test ? v.test_values : v.values, number, rng, draft));
    changes_model |= variation.term->changesModel();
  }
  if (changes_model && design_.recompute) recompute(model);

  Task made;
  made.description = words.empty() ? "as the settings say" : join(words);
  made.model = changes_model ? std::make_shared<const MujocoModel>(std::move(model)) : base_;
  auto design = std::make_shared<MjcfDesign>();
  design->outline(given_);
  Settings own;
  design->bind(own);
  own.read(parseYaml(settings.yaml(), "the settings"), "the settings");
  for (const std::string& assignment : draft.assignments) own.assign(assignment);
  design->find(*made.model);
  made.design = std::move(design);
  return made;
}

std::string MjcfFamily::taskName(int task) const { return splitTaskName("task", task, num_train_); }

std::string MjcfFamily::taskDescription(int task) const { return tasks_.at(task).description; }

std::unique_ptr<Env> MjcfFamily::create(int task) const {
  const Task& made = tasks_.at(task);
  return std::make_unique<MjcfEnv>(made.design, made.model);
}

}  // namespace pmeta
