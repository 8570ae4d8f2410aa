#pragma once

#include <memory>
#include <string>
#include <vector>

#include "pmeta_core/env/env.h"
#include "pmeta_core/mjcf/design.h"

namespace pmeta {

/// Robots that settings describe: a model file, terms of what is observed, done and rewarded, and
/// in what tasks differ. See describeTerms().
class MjcfFamily : public EnvFamily {
 public:
  void outline(const ListedSettings& given) override;
  void bind(Settings& settings) override { design_.bind(settings); }
  void build(std::uint64_t seed) override;
  int numTasks() const override { return num_train_; }
  int numTestTasks() const override { return static_cast<int>(tasks_.size()) - num_train_; }
  ModelChoice* model() override { return &design_.model; }
  std::string taskName(int task) const override;
  std::string taskDescription(int task) const override;
  std::unique_ptr<Env> create(int task) const override;

 private:
  struct Task {
    std::string description;
    std::shared_ptr<const MjcfDesign> design;
    std::shared_ptr<const MujocoModel> model;
  };
  Task drawTask(int task, const Settings& settings, std::uint64_t seed) const;

  ListedSettings given_;
  MjcfDesign design_;
  std::shared_ptr<const MujocoModel> base_;
  std::vector<Task> tasks_;
  int num_train_ = 0;
};

}  // namespace pmeta
