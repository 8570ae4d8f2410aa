#include "pmeta_core/nn/mlp.h"

#include <algorithm>
#include <cmath>

#include "pmeta_core/base/error.h"
#include "pmeta_core/nn/kernels.h"

namespace pmeta {
namespace {

// below these sizes dot products beat a matrix product, which first copies its factors
constexpr std::size_t kFewRows = 2;
constexpr std::size_t kFewOutputs = 8;

// V stands before the advantages in a row of heads
void combineHeads(const float* heads, std::size_t batch, std::size_t outputs, float* q) {
  for (std::size_t b = 0; b < batch; ++b, heads += outputs + 1, q += outputs) {
    float sum = 0;
    for (std::size_t a = 0; a < outputs; ++a) sum += heads[1 + a];
    const float offset = heads[0] - sum / static_cast<float>(outputs);
    for (std::size_t a = 0; a < outputs; ++a) q[a] = heads[1 + a] + offset;
  }
}

// dL/dV = sum of dL/dQ, dL/dA_a = dL/dQ_a - mean of dL/dQ
void splitHeads(const float* d_q, std::size_t batch, std::size_t outputs, float* d_heads) {
  for (std::size_t b = 0; b < batch; ++b, d_q += outputs, d_heads += outputs + 1) {
    float sum = 0;
    for (std::size_t a = 0; a < outputs; ++a) sum += d_q[a];
    const float mean = sum / static_cast<float>(outputs);
    d_heads[0] = sum;
    for (std::size_t a = 0; a < outputs; ++a) d_heads[1 + a] = d_q[a] - mean;
  }
}

}  // namespace

MlpWorkspace::MlpWorkspace(const Mlp& mlp, std::size_t max_batch) : max_batch_(max_batch) {
  if (max_batch == 0) throw Error("a network's workspace needs room for at least one sample.");
  std::size_t widest = 0;
  for (const Mlp::Layer& layer : mlp.layers_) {
    activations_.emplace_back(max_batch * layer.outputs);
    widest = std::max(widest, layer.outputs);
  }
  if (mlp.spec_.dueling) outputs_.resize(max_batch * mlp.spec_.outputs);
  delta_.resize(max_batch * widest);
  next_delta_.resize(max_batch * widest);
}

Mlp::Mlp(MlpSpec spec) : spec_(std::move(spec)), product_(spec_.portable ? &gemmEigen : &gemm) {
  const auto zero = std::find(spec_.hidden.begin(), spec_.hidden.end(), std::size_t{0});
  if (spec_.inputs == 0 || spec_.outputs == 0 || zero != spec_.hidden.end()) {
    throw Error("the network '" + spec_.prefix +
                "' needs at least one input, one output and one unit in each hidden layer.");
  }
  if (spec_.prefix.empty()) throw Error("a network needs a prefix for its blocks' names.");

  const auto addBlock = [&](const std::string& name, std::vector<std::size_t> shape) {
    blocks_.push_back({spec_.prefix + "." + name, std::move(shape)});
    size_ += blocks_.back().size();
  };
  std::size_t inputs = spec_.inputs;
  const auto addLayer = [&](std::size_t outputs) {
    const std::string name = "layer" + std::to_string(layers_.size());
    layers_.push_back({inputs, outputs, size_, size_ + inputs * outputs});
    addBlock(name + ".weight", {outputs, inputs});
    addBlock(name + ".bias", {outputs});
    inputs = outputs;
  };
  for (const std::size_t units : spec_.hidden) addLayer(units);
  if (!spec_.dueling) {
    addLayer(spec_.outputs);
    return;
  }
  // both heads' weights lie together, so that one product serves them
  layers_.push_back({inputs, 1 + spec_.outputs, size_, size_ + inputs * (1 + spec_.outputs)});
  addBlock("value.weight", {1, inputs});
  addBlock("advantage.weight", {spec_.outputs, inputs});
  addBlock("value.bias", {1});
  addBlock("advantage.bias", {spec_.outputs});
}

void Mlp::initialise(float* parameters, Rng& rng) const {
  for (const Layer& layer : layers_) {
    const double bound = 1 / std::sqrt(static_cast<double>(layer.inputs));
    const std::size_t end = layer.bias + layer.outputs;
    for (std::size_t k = layer.weight; k < end; ++k) {
      parameters[k] = static_cast<float>(bound * (2 * rng.uniform() - 1));
    }
  }
}

const float* Mlp::forward(const float* parameters, const float* input, std::size_t batch,
                          MlpWorkspace& workspace) const {
  if (batch > workspace.max_batch_) {
    throw Error("a batch of " + std::to_string(batch) +
                " does not fit the network's workspace of " + std::to_string(workspace.max_batch_) +
                ".");
  }
  const Kernels& kernel = kernels();
  const float* x = input;
  for (std::size_t l = 0; l < layers_.size(); ++l) {
    const Layer& layer = layers_[l];
    const float* weight = parameters + layer.weight;
    const float* bias = parameters + layer.bias;
    const bool hidden = l + 1 < layers_.size();
    const bool relu = hidden && spec_.activation == Activation::kRelu;
    float* y = workspace.activations_[l].data();
    if (batch <= kFewRows || layer.outputs <= kFewOutputs) {
      kernel.affine(x, weight, bias, y, batch, layer.inputs, layer.outputs, relu);
    } else {
      product_(Transpose::kNo, Transpose::kYes, batch, layer.outputs, layer.inputs, 1, x,
               layer.inputs, weight, layer.inputs, 0, y, layer.outputs);
      (relu ? kernel.addBiasRelu : kernel.addBias)(y, bias, batch, layer.outputs);
    }
    if (hidden && !relu) kernel.hyperbolicTangent(y, batch * layer.outputs);
    x = y;
  }
  if (!spec_.dueling) return x;
  combineHeads(x, batch, spec_.outputs, workspace.outputs_.data());
  return workspace.outputs_.data();
}

void Mlp::backward(const float* parameters, const float* input, std::size_t batch,
                   const float* d_output, float* gradient, float* d_input,
                   MlpWorkspace& workspace) const {
  backward(parameters, input, batch, d_output, gradient, 0, spec_.inputs, d_input, workspace);
}

void Mlp::backward(const float* parameters, const float* input, std::size_t batch,
                   const float* d_output, float* gradient, std::size_t first, std::size_t count,
                   float* d_input, MlpWorkspace& workspace) const {
  requireInputs(first, count);
  backwardThrough(parameters, input, batch, d_output, gradient, first, count, nullptr, d_input,
                  workspace);
}

void Mlp::requireInputs(std::size_t first, std::size_t count) const {
  if (first + count > spec_.inputs) {
    throw Error("the network '" + spec_.prefix + "' has " + std::to_string(spec_.inputs) +
                " inputs, none at " + std::to_string(first + count - 1) + ".");
  }
}

void Mlp::backwardInput(const float* parameters, std::size_t batch, const float* d_output,
                        std::size_t first, std::size_t count, float* d_input,
                        MlpWorkspace& workspace, const std::size_t* rows) const {
  requireInputs(first, count);
  backwardThrough(parameters, nullptr, batch, d_output, nullptr, first, count, rows, d_input,
                  workspace);
}

void Mlp::backwardThrough(const float* parameters, const float* input, std::size_t batch,
                          const float* d_output, float* gradient, std::size_t first,
                          std::size_t count, const std::size_t* rows, float* d_input,
                          MlpWorkspace& workspace) const {
  const Kernels& kernel = kernels();
  const auto throughActivation =
      spec_.activation == Activation::kRelu ? kernel.maskRelu : kernel.scaleByTanhSlope;
  const float* delta = d_output;
  if (spec_.dueling) {
    splitHeads(d_output, batch, spec_.outputs, workspace.delta_.data());
    delta = workspace.delta_.data();
  }
  float* next = workspace.next_delta_.data();
  for (std::size_t l = layers_.size(); l-- > 0;) {
    const Layer& layer = layers_[l];
    const std::size_t in = layer.inputs, out = layer.outputs;
    if (gradient != nullptr) {
      const float* x = l == 0 ? input : workspace.activations_[l - 1].data();
      product_(Transpose::kYes, Transpose::kNo, out, in, batch, 1, delta, out, x, in, 0,
               gradient + layer.weight, in);
      kernel.columnSums(delta, gradient + layer.bias, batch, out);
    }
    const float* weight = parameters + layer.weight;
    if (l == 0) {
      if (d_input == nullptr) return;
      product_(Transpose::kNo, Transpose::kNo, batch, count, out, 1, delta, out, weight + first, in,
               0, d_input, count);
      return;
    }
    product_(Transpose::kNo, Transpose::kNo, batch, in, out, 1, delta, out, weight, in, 0, next,
             in);
    const float* activations = workspace.activations_[l - 1].data();
    if (rows == nullptr) throughActivation(next, activations, batch * in);
    for (std::size_t b = 0; rows != nullptr && b < batch; ++b) {
      throughActivation(next + b * in, activations + rows[b] * in, in);
    }
    // what was just written is the next layer's; the other buffer is free
    delta = next;
    next = next == workspace.next_delta_.data() ? workspace.delta_.data()
                                                : workspace.next_delta_.data();
  }
}

}  // namespace pmeta
