#include "pmeta_core/learn/temperature.h"

#include <cmath>

namespace pmeta {

void bind(Settings& s, const std::string& prefix, TemperatureSettings& t) {
  s.bind(prefix + "temperature", t.temperature,
         "entropy temperature: auto follows a target entropy, fixed stays", {"auto", "fixed"});
  s.bind(prefix + "initial_temperature", t.initial_temperature,
         "entropy temperature at the start, and for good where fixed", Range::above(0));
  s.bind(prefix + "target_entropy", t.target_entropy,
         "entropy in nats that the temperature aims at; 0: minus the number of action components");
  s.bind(prefix + "temperature_learning_rate", t.temperature_learning_rate,
         "Adam's, on the logarithm of the temperature", Range::above(0));
}

Temperature::Temperature(const TemperatureSettings& settings, int action_size)
    : automatic_(settings.temperature == "auto"),
      target_entropy_(settings.target_entropy == 0 ? -action_size : settings.target_entropy),
      learning_rate_(settings.temperature_learning_rate),
      log_value_(std::log(settings.initial_temperature)) {}

double Temperature::value() const { return std::exp(log_value_); }

void Temperature::update(double mean_log_prob) {
  if (!automatic_) return;
  constexpr double kBeta1 = 0.9, kBeta2 = 0.999, kEps = 1e-8;
  const double g = gradient(mean_log_prob);
  ++updates_;
  first_moment_ = kBeta1 * first_moment_ + (1 - kBeta1) * g;
  second_moment_ = kBeta2 * second_moment_ + (1 - kBeta2) * g * g;
  const auto t = static_cast<double>(updates_);
  const double m = first_moment_ / (1 - std::pow(kBeta1, t));
  const double v = second_moment_ / (1 - std::pow(kBeta2, t));
  log_value_ -= learning_rate_ * m / (std::sqrt(v) + kEps);
}

void Temperature::saveState(StateWriter& writer) const {
  writer.value("log_value", log_value_);
  writer.value("first_moment", first_moment_);
  writer.value("second_moment", second_moment_);
  writer.count("updates", updates_);
}

void Temperature::loadState(StateReader& reader) {
  log_value_ = reader.finite("log_value");
  first_moment_ = reader.finite("first_moment");
  second_moment_ = reader.finite("second_moment");
  updates_ = reader.count("updates");
}

}  // namespace pmeta
