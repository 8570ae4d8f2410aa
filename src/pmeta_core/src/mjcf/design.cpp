#include "pmeta_core/mjcf/design.h"

#include <algorithm>
#include <cctype>
#include <sstream>

#include "pmeta_core/base/format.h"

namespace pmeta {
namespace {

void requireTermName(const std::string& key, const std::string& name) {
  const bool plain = !name.empty() && std::all_of(name.begin(), name.end(), [](unsigned char c) {
    return std::isalnum(c) != 0 || c == '_';
  });
  if (plain) return;
  throw Error("a term of " + key + " has the name " + shown(name) +
              " but must have one of letters, digits and _.");
}

template <class Kind, class Common>
void describeSection(const std::string& title, std::ostringstream& out) {
  out << "\n" << title << "\n";
  for (const std::string& name : termsOf<Kind>().names()) {
    const TermRow<Kind>& row = termsOf<Kind>().at(name);
    const auto term = row.make();
    Common common;
    Settings settings;
    TermSettings own(settings, name);
    term->bind(own);
    common.bind(own);
    out << "\n" << name << ": " << row.meaning << "\n" << settings.table(true);
  }
}

}  // namespace

void ObservationCommon::bind(TermSettings& settings) {
  settings.bind("clip", clip, "each number is kept from -clip to clip; 0: it is not",
                Range::atLeast(0));
}

void RewardCommon::bind(TermSettings& settings) {
  settings.bind("weight", weight, "that the term is multiplied by; below 0 for what costs");
  settings.bind("counts", counts,
                "in what: a term for evaluation alone is what returns are made of, e.g. 1 for a "
                "success",
                {"both", "training", "evaluation"});
}

void VariationCommon::bind(TermSettings& settings) {
  settings.bind("operation", operation,
                "what becomes of the number: it is set, scaled, or added to",
                {"set", "scale", "add"});
  settings.bind("values", values, "one, or one for each training task; [] draws them", {},
                Empty::kAllowed);
  settings.bind("test_values", test_values, "the same for test tasks", {}, Empty::kAllowed);
  settings.bind("range", range, "[low, high] of what is drawn, from the experiment's seed", {},
                Empty::kAllowed);
  settings.bind("distribution", distribution, "of what is drawn", {"uniform", "log_uniform"});
  settings.bind("independent", independent,
                "of several numbers each is drawn on its own; false: all get the same");
}

template <class Kind, class Common>
void Section<Kind, Common>::outline(const ListedSettings& given) {
  for (const auto& [key, value] : given) {
    if (key == key_ && value != "{}" && value != "~") {
      throw Error(key_ + " must hold terms by name, each with its settings below it.");
    }
    if (key.rfind(key_ + ".", 0) != 0) continue;
    const std::string rest = key.substr(key_.size() + 1);
    const std::string name = rest.substr(0, rest.find('.'));
    auto entry = std::find_if(entries_.begin(), entries_.end(),
                              [&](const Entry& one) { return one.name == name; });
    if (entry == entries_.end()) {
      requireTermName(key_, name);
      entries_.push_back({name, name, nullptr, {}});
      entry = entries_.end() - 1;
    }
    if (rest != name + ".term") continue;
    const YAML::Node kind = YAML::Load(value);
    entry->kind = kind.IsScalar() ? kind.Scalar() : value;
  }
  make();
}

template <class Kind, class Common>
void Section<Kind, Common>::make() {
  const std::vector<std::string> known = termsOf<Kind>().names();
  for (Entry& entry : entries_) {
    if (const TermRow<Kind>* row = termsOf<Kind>().find(entry.kind)) {
      entry.term = row->make();
      continue;
    }
    const std::string key = key_ + "." + entry.name;
    throw Error((entry.kind == entry.name
                     ? key + " has no term, and " + shown(entry.name) + " is none: write term: as "
                     : key + ".term is " + shown(entry.kind) + " but must be ") +
                "one of " + join(nearestFirst(entry.kind, known)) + didYouMean(entry.kind, known));
  }
}

template <class Kind, class Common>
void Section<Kind, Common>::makeDefault(const std::string& kind) {
  if (!entries_.empty()) return;
  entries_.push_back({kind, kind, nullptr, {}});
  make();
}

template <class Kind, class Common>
void Section<Kind, Common>::bind(Settings& settings) {
  const std::vector<std::string> known = termsOf<Kind>().names();
  for (Entry& entry : entries_) {
    TermSettings own(settings, key_ + "." + entry.name);
    own.bind("term", entry.kind, termsOf<Kind>().at(entry.kind).meaning, known);
    entry.term->bind(own);
    entry.common.bind(own);
  }
}

template <class Kind, class Common>
void Section<Kind, Common>::find(const MujocoModel& model, const OtherTerms& others) {
  for (Entry& entry : entries_) {
    entry.term->find(Elements(model, others, key_ + "." + entry.name));
  }
}

MjcfDesign::MjcfDesign()
    : goals("goals"),
      observations("observations"),
      actions("actions"),
      rewards("rewards"),
      terminations("terminations"),
      starts("starts"),
      variations("variations") {}

void MjcfDesign::outline(const ListedSettings& given) {
  goals.outline(given);
  observations.outline(given);
  actions.outline(given);
  actions.makeDefault("control");
  rewards.outline(given);
  terminations.outline(given);
  starts.outline(given);
  variations.outline(given);
}

void MjcfDesign::bind(Settings& settings) {
  const std::string group = "environment.";
  settings.bind(group + "model_file", model.file, "the robot: an MJCF or URDF file");
  settings.bind(group + "model_hash", model.hash,
                "no model but that of this hash is taken; \"\" takes any");
  settings.bind(group + "horizon", horizon, "steps after which an episode is truncated",
                Range::between(1, 1e6));
  settings.bind(group + "frame_skip", frame_skip, "timesteps of the model that a step takes",
                Range::between(1, 10000));
  settings.bind(group + "refresh", refresh,
                "work out positions, contacts and sensors once more where a step ends; false: they "
                "are as the last timestep found them, as in Gym");
  settings.bind(group + "single_precision", single_precision,
                "round observations to single precision");
  settings.bind(
      group + "recompute", recompute,
      "of a varied model, what MuJoCo derives from masses and lengths; false: it stays as "
      "the model has it");
  settings.bind(group + "train_tasks", train_tasks,
                "training tasks; 0: as many as the longest list of values",
                Range::between(0, 10000));
  settings.bind(group + "test_tasks", test_tasks,
                "test tasks; 0: as many as the longest list of test_values",
                Range::between(0, 10000));
  goals.bind(settings);
  observations.bind(settings);
  actions.bind(settings);
  rewards.bind(settings);
  terminations.bind(settings);
  starts.bind(settings);
  variations.bind(settings);
}

void MjcfDesign::find(const MujocoModel& opened) {
  if (observations.entries().empty()) {
    throw Error(
        "environment.observations has no terms: say what is observed, e.g. "
        "joint_positions: {}.");
  }
  if (rewards.entries().empty()) {
    throw Error(
        "environment.rewards has no terms: say what is rewarded, e.g. "
        "alive: {weight: 1}.");
  }
  OtherTerms others;
  for (const auto& goal : goals.entries()) others.goals.push_back(goal.name);
  actions.find(opened, others);
  for (const auto& action : actions.entries()) {
    for (const Quantity& one : action.term->quantities()) others.actions.push_back(one.name);
  }
  goals.find(opened, others);
  observations.find(opened, others);
  rewards.find(opened, others);
  terminations.find(opened, others);
  starts.find(opened, others);
  variations.find(opened, others);
}

std::string describeTerms() {
  std::ostringstream out;
  MjcfDesign design;
  Settings settings;
  design.bind(settings);
  out << "environment.name: mjcf, a robot of a model file. Its settings:\n" << settings.table(true);
  out << "\nIts terms, in sections of environment., each under a name of your own; `term` is what "
         "it "
         "is, and may be left out where the name says it:\n";
  describeSection<GoalTerm, NothingCommon>("goals: places to go to", out);
  describeSection<ObservationTerm, ObservationCommon>("observations: what is observed, in order",
                                                      out);
  describeSection<ActionTerm, NothingCommon>("actions: what an action drives, in order", out);
  describeSection<RewardTerm, RewardCommon>("rewards: what is summed up each step", out);
  describeSection<TerminationTerm, NothingCommon>("terminations: what ends an episode", out);
  describeSection<StartTerm, NothingCommon>("starts: how an episode starts, in order", out);
  describeSection<VariationTerm, VariationCommon>("variations: in what tasks differ", out);
  return out.str();
}

}  // namespace pmeta
