#include "common/conversions.h"

#include <iterator>
#include <limits>
#include <numeric>
#include <utility>

#include "pmeta_core/base/error.h"

namespace pmeta_nodes {
namespace {

using pmeta::Error;

std::vector<std::uint32_t> toUnsigned(const std::vector<int>& values) {
  return std::vector<std::uint32_t>(values.begin(), values.end());
}

// indices beyond int cannot be a task or round of any run
int toInt(std::uint32_t value, const char* what) {
  if (value > static_cast<std::uint32_t>(std::numeric_limits<int>::max())) {
    throw Error(std::string("a message has an impossible ") + what + ", " + std::to_string(value) +
                ".");
  }
  return static_cast<int>(value);
}

std::vector<int> toTasks(const std::vector<std::uint32_t>& values) {
  std::vector<int> tasks;
  for (const std::uint32_t value : values) tasks.push_back(toInt(value, "task"));
  return tasks;
}

pmeta::ModelView viewOf(const pmeta_msgs::ModelBlob& msg) {
  pmeta::ModelView view;
  view.layout = msg.layout;
  view.layout_hash = msg.layout_hash;
  view.floats = msg.float32_values.data();
  view.num_floats = msg.float32_values.size();
  view.doubles = msg.float64_values.data();
  view.num_doubles = msg.float64_values.size();
  view.present = msg.present.data();
  view.num_present = msg.present.size();
  view.checksum = msg.checksum;
  return view;
}

// all but the model
pmeta::MetaPolicy headerOf(const pmeta_msgs::MetaPolicy& msg) {
  pmeta::MetaPolicy meta;
  meta.run_id = msg.run_id;
  meta.round = toInt(msg.round, "round");
  meta.participants = toTasks(msg.participants);
  meta.evaluate = msg.evaluate != 0;
  meta.incarnation = msg.incarnation;
  meta.settings_hash = msg.settings_hash;
  meta.checkpoint = msg.checkpoint != 0;
  return meta;
}

pmeta::AuxiliaryUpdate headerOf(const pmeta_msgs::AuxiliaryUpdate& msg) {
  pmeta::AuxiliaryUpdate update;
  update.run_id = msg.run_id;
  update.task = toInt(msg.task, "task");
  update.round = toInt(msg.round, "round");
  update.weight = msg.weight;
  update.settings_hash = msg.settings_hash;
  return update;
}

}  // namespace

pmeta_msgs::ModelBlob toMsg(pmeta::Model model) {
  pmeta_msgs::ModelBlob msg;
  msg.layout = model.layout.text();
  msg.layout_hash = model.layout.hash();
  msg.checksum = model.checksum();
  if (model.layout.precision() == pmeta::Precision::kFloat32) {
    msg.float32_values = std::move(model.floats());
  } else {
    msg.float64_values = std::move(model.doubles());
  }
  msg.present = std::move(model.present);
  return msg;
}

pmeta::Model fromMsg(pmeta_msgs::ModelBlob msg) {
  pmeta::Model model;
  model.layout = pmeta::ModelLayout::parse(msg.layout);
  if (model.layout.hash() != msg.layout_hash) {
    throw Error("a model's layout hash " + pmeta::hexHash(msg.layout_hash) +
                " does not fit its layout, whose hash is " + pmeta::hexHash(model.layout.hash()) +
                ".");
  }
  const bool is_float = model.layout.precision() == pmeta::Precision::kFloat32;
  const std::size_t sent = is_float ? msg.float32_values.size() : msg.float64_values.size();
  const std::size_t other = is_float ? msg.float64_values.size() : msg.float32_values.size();
  if (other != 0) throw Error("a model carries values of another precision than its layout says.");
  if (sent != model.layout.size()) {
    throw Error("a model carries " + std::to_string(sent) + " values where its layout has " +
                std::to_string(model.layout.size()) + ".");
  }
  if (!msg.present.empty() && msg.present.size() != sent) {
    throw Error("a model carries a presence mask of " + std::to_string(msg.present.size()) +
                " entries for " + std::to_string(sent) + " values.");
  }
  if (is_float) {
    model.values = std::move(msg.float32_values);
  } else {
    model.values = std::move(msg.float64_values);
  }
  model.present = std::move(msg.present);
  if (model.checksum() != msg.checksum) {
    throw Error("a model's checksum does not fit its values: it was damaged on the way.");
  }
  return model;
}

pmeta_msgs::MetaPolicy toMsg(const pmeta::MetaPolicy& meta, int rounds) {
  pmeta_msgs::MetaPolicy msg;
  msg.run_id = meta.run_id;
  msg.round = static_cast<std::uint32_t>(meta.round);
  msg.rounds = static_cast<std::uint32_t>(rounds);
  msg.model = toMsg(meta.model);
  msg.participants = toUnsigned(meta.participants);
  msg.evaluate = static_cast<std::uint8_t>(meta.evaluate);
  msg.incarnation = meta.incarnation;
  msg.settings_hash = meta.settings_hash;
  msg.checkpoint = static_cast<std::uint8_t>(meta.checkpoint);
  return msg;
}

pmeta::MetaPolicy fromMsg(pmeta_msgs::MetaPolicy msg) {
  pmeta::MetaPolicy meta = headerOf(msg);
  meta.model = fromMsg(std::move(msg.model));
  return meta;
}

pmeta_msgs::AuxiliaryUpdate toMsg(pmeta::AuxiliaryUpdate update) {
  pmeta_msgs::AuxiliaryUpdate msg;
  msg.run_id = update.run_id;
  msg.task = static_cast<std::uint32_t>(update.task);
  msg.round = static_cast<std::uint32_t>(update.round);
  msg.model = toMsg(std::move(update.model));
  msg.weight = update.weight;
  msg.settings_hash = update.settings_hash;
  return msg;
}

pmeta::AuxiliaryUpdate fromMsg(pmeta_msgs::AuxiliaryUpdate msg) {
  pmeta::AuxiliaryUpdate update = headerOf(msg);
  update.model = fromMsg(std::move(msg.model));
  return update;
}

pmeta_msgs::TaskReturn toMsg(const pmeta::TaskReturn& result, const std::string& task_name) {
  pmeta_msgs::TaskReturn msg;
  msg.run_id = result.run_id;
  msg.task = static_cast<std::uint32_t>(result.task);
  msg.task_name = task_name;
  msg.round = static_cast<std::uint32_t>(result.round);
  msg.policy = result.policy == pmeta::PolicyKind::kPersonal ? pmeta_msgs::TaskReturn::PERSONAL
                                                             : pmeta_msgs::TaskReturn::META;
  msg.split = result.split == pmeta::Split::kTrain ? pmeta_msgs::TaskReturn::TRAIN
                                                   : pmeta_msgs::TaskReturn::TEST;
  msg.scheduled = static_cast<std::uint8_t>(result.scheduled);
  msg.policy_name = pmeta::name(result.policy);
  msg.split_name = pmeta::name(result.split);
  msg.context_episodes = static_cast<std::uint32_t>(result.context_episodes);
  msg.return_mean = result.mean;
  msg.return_std = result.std;
  msg.episodes = static_cast<std::uint32_t>(result.episodes);
  msg.env_steps = static_cast<std::uint64_t>(result.env_steps);
  msg.updates = static_cast<std::uint64_t>(result.updates);
  msg.broken_episodes = static_cast<std::uint64_t>(result.broken_episodes);
  for (const pmeta::Loss& loss : result.losses) {
    msg.loss_names.push_back(loss.name);
    msg.losses.push_back(loss.value);
  }
  msg.wall_s = result.seconds;
  return msg;
}

pmeta::TaskReturn fromMsg(const pmeta_msgs::TaskReturn& msg) {
  if (msg.policy != pmeta_msgs::TaskReturn::PERSONAL &&
      msg.policy != pmeta_msgs::TaskReturn::META) {
    throw Error("a return is of no known policy (" + std::to_string(msg.policy) + ").");
  }
  if (msg.split != pmeta_msgs::TaskReturn::TRAIN && msg.split != pmeta_msgs::TaskReturn::TEST) {
    throw Error("a return is of no known split (" + std::to_string(msg.split) + ").");
  }
  pmeta::TaskReturn result;
  result.run_id = msg.run_id;
  result.task = toInt(msg.task, "task");
  result.round = toInt(msg.round, "round");
  result.policy = msg.policy == pmeta_msgs::TaskReturn::PERSONAL ? pmeta::PolicyKind::kPersonal
                                                                 : pmeta::PolicyKind::kMeta;
  result.split =
      msg.split == pmeta_msgs::TaskReturn::TRAIN ? pmeta::Split::kTrain : pmeta::Split::kTest;
  result.scheduled = msg.scheduled != 0;
  result.context_episodes = toInt(msg.context_episodes, "number of context episodes");
  result.mean = msg.return_mean;
  result.std = msg.return_std;
  result.episodes = toInt(msg.episodes, "number of episodes");
  result.env_steps = static_cast<std::int64_t>(msg.env_steps);
  result.updates = static_cast<std::int64_t>(msg.updates);
  result.broken_episodes = static_cast<std::int64_t>(msg.broken_episodes);
  if (msg.loss_names.size() != msg.losses.size()) {
    throw Error("a return has " + std::to_string(msg.losses.size()) + " losses of " +
                std::to_string(msg.loss_names.size()) + " names.");
  }
  for (std::size_t i = 0; i < msg.losses.size(); ++i) {
    result.losses.push_back({msg.loss_names[i], msg.losses[i]});
  }
  result.seconds = msg.wall_s;
  return result;
}

pmeta_msgs::Trajectory toMsg(const pmeta::Episode& episode, const pmeta::Experiment& experiment,
                             int task, int round, pmeta::PolicyKind policy) {
  pmeta_msgs::Trajectory msg;
  msg.header.frame_id = "task_" + std::to_string(task);
  msg.run_id = experiment.settings().run_id;
  msg.task = static_cast<std::uint32_t>(task);
  msg.task_name = experiment.family().taskName(task);
  msg.task_description = experiment.family().taskDescription(task);
  msg.environment = experiment.settings().environment;
  msg.round = static_cast<std::uint32_t>(round);
  msg.policy = policy == pmeta::PolicyKind::kPersonal ? pmeta_msgs::Trajectory::PERSONAL
                                                      : pmeta_msgs::Trajectory::META;
  msg.observation_size = static_cast<std::uint32_t>(episode.observation_size);
  msg.observations = episode.observations;
  msg.action_size = static_cast<std::uint32_t>(episode.action_size);
  msg.actions = episode.actions;
  msg.rewards = episode.rewards;
  msg.position_size = static_cast<std::uint32_t>(episode.position_size);
  msg.positions = episode.positions;
  msg.terminated = episode.terminated;
  msg.truncated = episode.truncated;
  msg.episode_return = std::accumulate(episode.rewards.begin(), episode.rewards.end(), 0.0);
  msg.state_values = episode.state_values;
  msg.greedy_actions = episode.greedy_actions;
  msg.task_weights = episode.task_weights;
  msg.action_grid = static_cast<std::uint32_t>(episode.action_grid);
  msg.action_values = episode.action_values;
  return msg;
}

pmeta_msgs::RoundSummary toMsg(const pmeta::RoundSummary& summary,
                               const pmeta::Experiment& experiment) {
  pmeta_msgs::RoundSummary msg;
  msg.run_id = summary.run_id;
  msg.experiment = experiment.settings().experiment;
  msg.round = static_cast<std::uint32_t>(summary.round);
  msg.rounds = static_cast<std::uint32_t>(summary.rounds);
  msg.personal_return = summary.personal_return;
  msg.meta_return = summary.meta_return;
  msg.test_return = summary.test_return;
  msg.participants = toUnsigned(summary.participants);
  msg.missing = toUnsigned(summary.missing);
  msg.excluded = toUnsigned(summary.excluded);
  msg.round_s = summary.seconds;
  msg.eta_s = summary.eta_seconds;
  return msg;
}

pmeta::RoundSummary fromMsg(const pmeta_msgs::RoundSummary& msg) {
  pmeta::RoundSummary summary;
  summary.run_id = msg.run_id;
  summary.round = toInt(msg.round, "round");
  summary.rounds = toInt(msg.rounds, "number of rounds");
  summary.personal_return = msg.personal_return;
  summary.meta_return = msg.meta_return;
  summary.test_return = msg.test_return;
  summary.participants = toTasks(msg.participants);
  summary.missing = toTasks(msg.missing);
  summary.excluded = toTasks(msg.excluded);
  summary.seconds = msg.round_s;
  summary.eta_seconds = msg.eta_s;
  return summary;
}

pmeta_msgs::Scores toScores(const pmeta::RoundBook::Round& round,
                            const pmeta::Experiment& experiment) {
  const double none = std::numeric_limits<double>::quiet_NaN();
  const int tasks = experiment.totalTasks();
  pmeta_msgs::Scores msg;
  msg.run_id = round.summary.run_id;
  msg.experiment = experiment.settings().experiment;
  msg.round = static_cast<std::uint32_t>(round.summary.round);
  msg.rounds = static_cast<std::uint32_t>(round.summary.rounds);
  for (int task = 0; task < tasks; ++task) msg.tasks.push_back(experiment.family().taskName(task));
  msg.training_tasks = static_cast<std::uint32_t>(experiment.numTasks());
  msg.personal.assign(tasks, none);
  msg.meta.assign(tasks, none);
  for (const pmeta::RoundRow& row : round.rows) {
    const pmeta::TaskReturn& result = row.result;
    if (result.policy == pmeta::PolicyKind::kPersonal) {
      msg.personal.at(result.task) = result.mean;
    } else if (result.context_episodes == experiment.contextEpisodes().back()) {
      msg.meta.at(result.task) = result.mean;
    }
  }
  msg.personal_mean = round.summary.personal_return;
  msg.meta_mean = round.summary.meta_return;
  msg.test_mean = round.summary.test_return;
  return msg;
}

std::string stateName(const pmeta_msgs::AgentStatus& msg) {
  const char* const names[] = {"unknown", "waiting", "training", "evaluating", "done", "failed"};
  return names[msg.state < std::size(names) ? msg.state : 0];
}

std::string stateName(const pmeta_msgs::RoundSummary& msg) {
  const char* const names[] = {"unknown", "running", "late",   "finished",
                               "stopped", "paused",  "blocked"};
  return names[msg.state < std::size(names) ? msg.state : 0];
}

pmeta::Mac macOf(const pmeta::Authenticator& authenticator, const pmeta_msgs::AgentStatus& msg) {
  return authenticator.mac(
      {msg.run_id, toInt(msg.task, "task"), msg.state, msg.message, msg.incarnation});
}

pmeta::Mac macOf(const pmeta::Authenticator& authenticator,
                 const pmeta_msgs::AuxiliaryUpdate& msg) {
  return authenticator.mac(headerOf(msg), viewOf(msg.model));
}

pmeta::Mac macOf(const pmeta::Authenticator& authenticator, const pmeta_msgs::MetaPolicy& msg) {
  return authenticator.mac(headerOf(msg), viewOf(msg.model), toInt(msg.rounds, "number of rounds"));
}

pmeta::Mac macOf(const pmeta::Authenticator& authenticator, const pmeta_msgs::TaskReturn& msg) {
  return authenticator.mac(fromMsg(msg), msg.task_name);
}

pmeta::Mac macOf(const pmeta::Authenticator& authenticator, const pmeta_msgs::RoundSummary& msg) {
  pmeta::RoundNews news;
  news.experiment = msg.experiment;
  news.state = msg.state;
  news.message = msg.message;
  news.refused = msg.refused;
  news.stamp = static_cast<std::int64_t>(msg.header.stamp.toNSec());
  return authenticator.mac(fromMsg(msg), news);
}

}  // namespace pmeta_nodes
