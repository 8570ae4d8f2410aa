#include "pmeta_core/env/one_body.h"

#include <utility>

namespace pmeta {

struct OneBody::Shared {
  std::unique_ptr<Env> env;
  const Handle* acting = nullptr;  ///< whose episode it is
};

class OneBody::Handle : public Env {
 public:
  explicit Handle(std::shared_ptr<Shared> shared)
      : shared_(std::move(shared)), spec_(shared_->env->spec()) {
    spec_.restorable = false;
  }
  ~Handle() override {
    if (shared_->acting == this) shared_->acting = nullptr;
  }

  const EnvSpec& spec() const override { return spec_; }
  void reset(Rng& rng, double* observation) override {
    shared_->acting = this;
    shared_->env->reset(rng, observation);
  }
  Step step(const double* action, Rng& rng, double* observation) override {
    if (interrupted()) throw BrokenEpisode("an episode of " + spec_.name + ", ended by another");
    return shared_->env->step(action, rng, observation);
  }
  bool interrupted() const override {
    return shared_->acting != this || shared_->env->interrupted();
  }
  std::vector<double> configuration() const override { return shared_->env->configuration(); }
  const MujocoModel* model() const override { return shared_->env->model(); }

 private:
  std::shared_ptr<Shared> shared_;
  EnvSpec spec_;
};

OneBody::OneBody(std::unique_ptr<Env> env) : shared_(std::make_shared<Shared>()) {
  shared_->env = std::move(env);
}

OneBody::~OneBody() = default;

std::unique_ptr<Env> OneBody::handle() const { return std::make_unique<Handle>(shared_); }

}  // namespace pmeta
