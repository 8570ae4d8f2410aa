#include "pmeta_core/baselines/gaussian_mlp.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "pmeta_core/base/error.h"

namespace pmeta {
namespace {

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Map = Eigen::Map<Matrix>;
using ConstMap = Eigen::Map<const Matrix>;
using RowMap = Eigen::Map<Eigen::RowVectorXd>;
using ConstRowMap = Eigen::Map<const Eigen::RowVectorXd>;

const double kLogStdFloor = std::log(1e-6);

ConstMap matrix(const double* values, std::size_t rows, std::size_t columns) {
  return {values, static_cast<Eigen::Index>(rows), static_cast<Eigen::Index>(columns)};
}

Map matrix(double* values, std::size_t rows, std::size_t columns) {
  return {values, static_cast<Eigen::Index>(rows), static_cast<Eigen::Index>(columns)};
}

ConstRowMap row(const double* values, std::size_t n) {
  return {values, static_cast<Eigen::Index>(n)};
}

RowMap row(double* values, std::size_t n) { return {values, static_cast<Eigen::Index>(n)}; }

}  // namespace

GaussianMlp::GaussianMlp(std::size_t inputs, const std::vector<int>& hidden, std::size_t actions) {
  if (inputs == 0 || actions == 0 ||
      std::any_of(hidden.begin(), hidden.end(), [](int units) { return units < 1; })) {
    throw Error("a policy needs at least one input, one action and one unit in each layer.");
  }
  std::size_t width = inputs;
  const auto layer = [&](std::size_t outputs) {
    const std::string name = "policy.layer" + std::to_string(layers_.size());
    layers_.push_back({width, outputs, size_, size_ + outputs * width});
    blocks_.push_back({name + ".weight", {outputs, width}});
    blocks_.push_back({name + ".bias", {outputs}});
    size_ += outputs * (width + 1);
    width = outputs;
  };
  for (const int units : hidden) layer(static_cast<std::size_t>(units));
  layer(actions);
  blocks_.push_back({"policy.log_std", {actions}});
  size_ += actions;
}

void GaussianMlp::initialise(double* parameters, double log_std, Rng& rng) const {
  std::fill_n(parameters, size_, 0.0);
  for (const Layer& layer : layers_) {
    const double bound = std::sqrt(6.0 / static_cast<double>(layer.inputs + layer.outputs));
    for (std::size_t k = layer.weight; k < layer.bias; ++k) {
      parameters[k] = bound * (2 * rng.uniform() - 1);
    }
  }
  std::fill_n(parameters + logStdOffset(), actions(), log_std);
}

std::vector<double> GaussianMlp::logStd(const double* parameters) const {
  std::vector<double> log_std(parameters + logStdOffset(), parameters + size_);
  for (double& value : log_std) value = std::max(value, kLogStdFloor);
  return log_std;
}

void GaussianMlp::forward(const double* parameters, const double* observations, std::size_t rows,
                          Pass& pass) const {
  pass.rows = rows;
  pass.activations.resize(layers_.size() + 1);
  pass.activations[0].assign(observations, observations + rows * inputs());
  for (std::size_t l = 0; l < layers_.size(); ++l) {
    const Layer& layer = layers_[l];
    pass.activations[l + 1].resize(rows * layer.outputs);
    auto output = matrix(pass.activations[l + 1].data(), rows, layer.outputs);
    output.noalias() = matrix(pass.activations[l].data(), rows, layer.inputs) *
                       matrix(parameters + layer.weight, layer.outputs, layer.inputs).transpose();
    output.rowwise() += row(parameters + layer.bias, layer.outputs);
    if (l + 1 == layers_.size()) break;
    for (double& value : pass.activations[l + 1]) value = std::tanh(value);
  }
}

void GaussianMlp::backward(const double* parameters, const Pass& pass,
                           const std::vector<double>& d_mean, const std::vector<double>& d_log_std,
                           double* gradient) const {
  Matrix delta = matrix(d_mean.data(), pass.rows, actions());
  for (std::size_t l = layers_.size(); l-- > 0;) {
    const Layer& layer = layers_[l];
    const auto input = matrix(pass.activations[l].data(), pass.rows, layer.inputs);
    matrix(gradient + layer.weight, layer.outputs, layer.inputs).noalias() =
        delta.transpose() * input;
    row(gradient + layer.bias, layer.outputs) = delta.colwise().sum();
    if (l == 0) break;
    const Matrix d_input = delta * matrix(parameters + layer.weight, layer.outputs, layer.inputs);
    delta = (1 - input.array().square()) * d_input.array();
  }
  storeLogStd(parameters, d_log_std, gradient);
}

void GaussianMlp::forwardAlong(const double* parameters, const double* direction, const Pass& pass,
                               Tangent& tangent) const {
  tangent.activations.resize(layers_.size() + 1);
  for (std::size_t l = 0; l < layers_.size(); ++l) {
    const Layer& layer = layers_[l];
    tangent.activations[l + 1].resize(pass.rows * layer.outputs);
    auto r_output = matrix(tangent.activations[l + 1].data(), pass.rows, layer.outputs);
    r_output.noalias() = matrix(pass.activations[l].data(), pass.rows, layer.inputs) *
                         matrix(direction + layer.weight, layer.outputs, layer.inputs).transpose();
    r_output.rowwise() += row(direction + layer.bias, layer.outputs);
    if (l > 0) {
      r_output.noalias() +=
          matrix(tangent.activations[l].data(), pass.rows, layer.inputs) *
          matrix(parameters + layer.weight, layer.outputs, layer.inputs).transpose();
    }
    if (l + 1 == layers_.size()) break;
    const auto output = matrix(pass.activations[l + 1].data(), pass.rows, layer.outputs);
    r_output.array() *= 1 - output.array().square();
  }
}

void GaussianMlp::backwardAlong(const double* parameters, const double* direction, const Pass& pass,
                                const Tangent& tangent, const std::vector<double>& d_mean,
                                const std::vector<double>& r_d_mean,
                                const std::vector<double>& r_d_log_std, double* product) const {
  Matrix delta = matrix(d_mean.data(), pass.rows, actions());
  Matrix r_delta = matrix(r_d_mean.data(), pass.rows, actions());
  for (std::size_t l = layers_.size(); l-- > 0;) {
    const Layer& layer = layers_[l];
    const auto weight = matrix(parameters + layer.weight, layer.outputs, layer.inputs);
    const auto input = matrix(pass.activations[l].data(), pass.rows, layer.inputs);
    auto r_weight = matrix(product + layer.weight, layer.outputs, layer.inputs);
    r_weight.noalias() = r_delta.transpose() * input;
    row(product + layer.bias, layer.outputs) = r_delta.colwise().sum();
    if (l == 0) break;  // the observations do not move
    const auto r_input = matrix(tangent.activations[l].data(), pass.rows, layer.inputs);
    r_weight.noalias() += delta.transpose() * r_input;
    const Matrix d_input = delta * weight;
    Matrix r_d_input = r_delta * weight;
    r_d_input.noalias() += delta * matrix(direction + layer.weight, layer.outputs, layer.inputs);
    const auto slope = 1 - input.array().square();
    r_delta = slope * r_d_input.array() - 2 * input.array() * r_input.array() * d_input.array();
    delta = slope * d_input.array();
  }
  storeLogStd(parameters, r_d_log_std, product);
}

// below its floor log sigma moves nothing
void GaussianMlp::storeLogStd(const double* parameters, const std::vector<double>& d_log_std,
                              double* gradient) const {
  for (std::size_t j = 0; j < actions(); ++j) {
    const bool moves = parameters[logStdOffset() + j] >= kLogStdFloor;
    gradient[logStdOffset() + j] = moves ? d_log_std[j] : 0;
  }
}

}  // namespace pmeta
