#include "pmeta_core/nn/mlp.h"

#include <algorithm>
#include <cmath>
#include <utility>

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

// the weighted sum of a row's heads
void mixHeads(const float* heads, const float* weights, std::size_t batch, std::size_t count,
              std::size_t outputs, float* mixed) {
  std::fill_n(mixed, batch * outputs, 0.0f);
  for (std::size_t b = 0; b < batch; ++b, mixed += outputs) {
    for (std::size_t k = 0; k < count; ++k, heads += outputs) {
      const float weight = weights[b * count + k];
      for (std::size_t o = 0; o < outputs; ++o) mixed[o] += weight * heads[o];
    }
  }
}

// each head's share of the gradient by their sum
void shareGradient(const float* d_mixed, const float* weights, std::size_t count,
                   std::size_t outputs, float* d_heads) {
  for (std::size_t k = 0; k < count; ++k, d_heads += outputs) {
    for (std::size_t o = 0; o < outputs; ++o) d_heads[o] = weights[k] * d_mixed[o];
  }
}

}  // namespace

MlpSpec mlpSpec(std::string prefix, std::size_t inputs, const std::vector<int>& hidden,
                std::size_t outputs, bool portable) {
  MlpSpec spec;
  spec.prefix = std::move(prefix);
  spec.inputs = inputs;
  spec.hidden.assign(hidden.begin(), hidden.end());
  spec.outputs = outputs;
  spec.portable = portable;
  return spec;
}

MlpWorkspace::MlpWorkspace(const Mlp& mlp, std::size_t max_batch) : max_batch_(max_batch) {
  if (max_batch == 0) throw Error("a network's workspace needs room for at least one sample.");
  std::size_t widest = 0;
  for (const Mlp::Layer& layer : mlp.layers_) {
    activations_.emplace_back(max_batch * layer.outputs);
    widest = std::max(widest, layer.outputs);
  }
  if (mlp.spec_.dueling || mlp.spec_.heads > 1) outputs_.resize(max_batch * mlp.spec_.outputs);
  if (mlp.spec_.heads > 1) head_weights_.resize(max_batch * mlp.spec_.heads);
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
  const bool weighed = spec_.head_input + spec_.heads <= spec_.inputs && !spec_.dueling;
  if (spec_.heads == 0 || (spec_.heads > 1 && !weighed)) {
    throw Error("the network '" + spec_.prefix + "' cannot have " + std::to_string(spec_.heads) +
                " heads: each needs an input that weighs it, and none of them is dueling.");
  }

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
    addLayer(spec_.heads * spec_.outputs);
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
  return combine(input, batch, workspace);
}

const float* Mlp::combine(const float* input, std::size_t batch, MlpWorkspace& workspace) const {
  const float* last = workspace.activations_.back().data();
  float* outputs = workspace.outputs_.data();
  if (spec_.dueling) {
    combineHeads(last, batch, spec_.outputs, outputs);
  } else if (spec_.heads > 1) {
    float* weights = workspace.head_weights_.data();
    for (std::size_t b = 0; b < batch; ++b) {
      std::copy_n(input + b * spec_.inputs + spec_.head_input, spec_.heads,
                  weights + b * spec_.heads);
    }
    mixHeads(last, weights, batch, spec_.heads, spec_.outputs, outputs);
  } else {
    return last;
  }
  return outputs;
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
  const float* delta = split(d_output, batch, rows, workspace);
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
      if (spec_.heads > 1) addWeighing(d_output, batch, rows, first, count, d_input, workspace);
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

const float* Mlp::split(const float* d_output, std::size_t batch, const std::size_t* rows,
                        MlpWorkspace& workspace) const {
  float* delta = workspace.delta_.data();
  if (spec_.dueling) {
    splitHeads(d_output, batch, spec_.outputs, delta);
  } else if (spec_.heads > 1) {
    for (std::size_t b = 0; b < batch; ++b) {
      const std::size_t row = rows == nullptr ? b : rows[b];
      shareGradient(d_output + b * spec_.outputs, &workspace.head_weights_[row * spec_.heads],
                    spec_.heads, spec_.outputs, delta + b * spec_.heads * spec_.outputs);
    }
  } else {
    return d_output;
  }
  return delta;
}

// by the inputs that weigh heads: what each head puts out, times the gradient by their sum
void Mlp::addWeighing(const float* d_output, std::size_t batch, const std::size_t* rows,
                      std::size_t first, std::size_t count, float* d_input,
                      const MlpWorkspace& workspace) const {
  const std::size_t begin = std::max(first, spec_.head_input);
  const std::size_t end = std::min(first + count, spec_.head_input + spec_.heads);
  for (std::size_t b = 0; b < batch; ++b) {
    const std::size_t row = rows == nullptr ? b : rows[b];
    for (std::size_t i = begin; i < end; ++i) {
      const std::size_t head = row * spec_.heads + i - spec_.head_input;
      const float* output = &workspace.activations_.back()[head * spec_.outputs];
      for (std::size_t o = 0; o < spec_.outputs; ++o) {
        d_input[b * count + i - first] += d_output[b * spec_.outputs + o] * output[o];
      }
    }
  }
}

}  // namespace pmeta
