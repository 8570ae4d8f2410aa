#include "pmeta_core/nn/gru.h"

#include <algorithm>
#include <functional>
#include <numeric>
#include <utility>

#include "pmeta_core/base/error.h"
#include "pmeta_core/nn/held_signals.h"
#include "pmeta_core/nn/kernels.h"

namespace pmeta {

GruWorkspace::GruWorkspace(const Gru& gru, std::size_t max_rows, std::size_t max_batch)
    : max_rows_(max_rows),
      max_batch_(max_batch),
      gates_(max_rows * 4 * gru.units()),
      previous_(max_rows * gru.units()),
      hidden_(max_rows * gru.units()),
      transposed_(3 * gru.units() * gru.units()),
      recurrent_(max_batch * 3 * gru.units()),
      carried_(max_batch * gru.units()),
      next_carried_(carried_.size()),
      sums_(4 * gru.units()) {
  if (max_batch == 0 || max_rows < max_batch) {
    throw Error("a recurrent network's workspace needs room for one step of all its sequences.");
  }
  batches_.reserve(max_rows);
}

Gru::Gru(GruSpec spec) : spec_(std::move(spec)), product_(spec_.portable ? &gemmEigen : &gemm) {
  if (spec_.inputs == 0 || spec_.units == 0) {
    throw Error("the network '" + spec_.prefix + "' needs at least one input and one unit.");
  }
  if (spec_.prefix.empty()) throw Error("a network needs a prefix for its blocks' names.");
  const std::size_t gates = 3 * spec_.units;
  blocks_ = {{spec_.prefix + ".weight_ih", {gates, spec_.inputs}},
             {spec_.prefix + ".weight_hh", {gates, spec_.units}},
             {spec_.prefix + ".bias_ih", {gates}},
             {spec_.prefix + ".bias_hh", {gates}}};
  weight_hh_ = gates * spec_.inputs;
  bias_ih_ = weight_hh_ + gates * spec_.units;
  bias_hh_ = bias_ih_ + gates;
  size_ = bias_hh_ + gates;
}

const float* Gru::unroll(const float* parameters, const float* input,
                         const std::vector<std::size_t>& batches, const float* initial,
                         GruWorkspace& workspace) const {
  const std::size_t rows = std::accumulate(batches.begin(), batches.end(), std::size_t{0});
  if (batches.empty() || batches.back() == 0 || batches.front() > workspace.max_batch_ ||
      rows > workspace.max_rows_) {
    throw Error("an unroll needs a sequence at each step, and has room for " +
                std::to_string(workspace.max_batch_) + " sequences and " +
                std::to_string(workspace.max_rows_) + " steps in all.");
  }
  if (!std::is_sorted(batches.begin(), batches.end(), std::greater<std::size_t>())) {
    throw Error("an unroll needs its sequences longest first.");
  }
  workspace.batches_ = batches;
  // few rows at a time: the product is faster on a weight that it need not transpose each time
  const std::size_t units = spec_.units;
  const float* weight = parameters + weight_hh_;
  for (std::size_t row = 0; row < 3 * units; ++row) {
    for (std::size_t k = 0; k < units; ++k) {
      workspace.transposed_[k * 3 * units + row] = weight[row * units + k];
    }
  }
  forward(parameters, input, initial, Transpose::kNo, workspace);
  return workspace.hidden_.data();
}

void Gru::step(const float* parameters, const float* input, std::size_t batch, float* hidden,
               GruWorkspace& workspace) const {
  if (batch > workspace.max_batch_) {
    throw Error(std::to_string(batch) +
                " sequences do not fit a recurrent network's workspace of " +
                std::to_string(workspace.max_batch_) + ".");
  }
  workspace.batches_.assign(1, batch);
  forward(parameters, input, hidden, Transpose::kYes, workspace);
  std::copy_n(workspace.hidden_.data(), batch * spec_.units, hidden);
}

// y <- x op(W) + bias, with `stride` floats from one row of y to the next
void Gru::linear(const float* x, std::size_t rows, std::size_t inputs, Transpose transpose,
                 const float* weight, const float* bias, std::size_t outputs, float* y,
                 std::size_t stride) const {
  for (std::size_t b = 0; b < rows; ++b) std::copy_n(bias, outputs, y + b * stride);
  product_(Transpose::kNo, transpose, rows, outputs, inputs, 1, x, inputs, weight,
           transpose == Transpose::kYes ? inputs : outputs, 1, y, stride);
}

// `recurrent`: kYes takes weight_hh as it is, kNo what is transposed in the workspace
void Gru::forward(const float* parameters, const float* input, const float* initial,
                  Transpose recurrent, GruWorkspace& workspace) const {
  const std::size_t units = spec_.units, inputs = spec_.inputs;
  const HeldSignals held;  // once, not for every product
  const std::vector<std::size_t>& batches = workspace.batches_;
  const std::size_t rows = std::accumulate(batches.begin(), batches.end(), std::size_t{0});
  const float *bias_ih = parameters + bias_ih_, *bias_hh = parameters + bias_hh_;

  // what the inputs give, of all steps at once; n goes before r and z, so that r, z, q, which the
  // hidden state acts through, lie together
  float* gates = workspace.gates_.data();
  linear(input, rows, inputs, Transpose::kYes, parameters, bias_ih, 2 * units, gates + units,
         4 * units);
  linear(input, rows, inputs, Transpose::kYes, parameters + 2 * units * inputs, bias_ih + 2 * units,
         units, gates, 4 * units);

  const float* weight_hh =
      recurrent == Transpose::kYes ? parameters + weight_hh_ : workspace.transposed_.data();
  float* previous = workspace.previous_.data();
  float* hidden = workspace.hidden_.data();
  const float* last = initial;
  for (const std::size_t batch : batches) {
    const std::size_t n = batch * units;
    last == nullptr ? std::fill_n(previous, n, 0.0f) : std::copy_n(last, n, previous);
    linear(previous, batch, units, recurrent, weight_hh, bias_hh, 3 * units,
           workspace.recurrent_.data(), 3 * units);
    kernels().gruForward(gates, workspace.recurrent_.data(), previous, hidden, batch, units);
    last = hidden;
    gates += 4 * n;
    previous += n;
    hidden += n;
  }
}

void Gru::backward(const float* parameters, const float* input, const float* d_hidden,
                   float* gradient, float* d_input, float* d_initial,
                   GruWorkspace& workspace) const {
  const HeldSignals held;
  backwardThroughTime(parameters, d_hidden, workspace);
  const std::size_t units = spec_.units, inputs = spec_.inputs, stride = 4 * units;
  const std::vector<std::size_t>& batches = workspace.batches_;
  const std::size_t rows = std::accumulate(batches.begin(), batches.end(), std::size_t{0});
  const float *d_n = workspace.gates_.data(), *d_rz = d_n + units, *d_rzq = d_rz;

  // products with all steps at once
  const std::size_t n_rows = 2 * units * inputs;  // where weight_ih has those of n
  product_(Transpose::kYes, Transpose::kNo, 2 * units, inputs, rows, 1, d_rz, stride, input, inputs,
           0, gradient, inputs);
  product_(Transpose::kYes, Transpose::kNo, units, inputs, rows, 1, d_n, stride, input, inputs, 0,
           gradient + n_rows, inputs);
  product_(Transpose::kYes, Transpose::kNo, 3 * units, units, rows, 1, d_rzq, stride,
           workspace.previous_.data(), units, 0, gradient + weight_hh_, units);
  float* sums = workspace.sums_.data();
  kernels().columnSums(d_n, sums, rows, stride);
  std::copy_n(sums + units, 2 * units, gradient + bias_ih_);
  std::copy_n(sums, units, gradient + bias_ih_ + 2 * units);
  std::copy_n(sums + units, 3 * units, gradient + bias_hh_);

  if (d_input != nullptr) {
    product_(Transpose::kNo, Transpose::kNo, rows, inputs, 2 * units, 1, d_rz, stride, parameters,
             inputs, 0, d_input, inputs);
    product_(Transpose::kNo, Transpose::kNo, rows, inputs, units, 1, d_n, stride,
             parameters + n_rows, inputs, 1, d_input, inputs);
  }
  if (d_initial != nullptr) {
    std::copy_n(workspace.carried_.data(), batches.front() * units, d_initial);
  }
}

// turns the gates into gradients by their sums, the last step first
void Gru::backwardThroughTime(const float* parameters, const float* d_hidden,
                              GruWorkspace& workspace) const {
  const std::size_t units = spec_.units;
  const std::vector<std::size_t>& batches = workspace.batches_;
  AlignedFloats &carried = workspace.carried_, &next = workspace.next_carried_;
  // sequences that are over pass on nothing yet, in either buffer
  std::fill(carried.begin(), carried.end(), 0.0f);
  std::fill(next.begin(), next.end(), 0.0f);
  std::size_t row = std::accumulate(batches.begin(), batches.end(), std::size_t{0});
  for (std::size_t t = batches.size(); t-- > 0;) {
    const std::size_t batch = batches[t];
    row -= batch;
    for (std::size_t k = 0; k < batch * units; ++k) carried[k] += d_hidden[row * units + k];
    float* gates = &workspace.gates_[row * 4 * units];
    kernels().gruBackward(gates, &workspace.previous_[row * units], carried.data(), next.data(),
                          batch, units);
    product_(Transpose::kNo, Transpose::kNo, batch, units, 3 * units, 1, gates + units, 4 * units,
             parameters + weight_hh_, units, 1, next.data(), units);
    carried.swap(next);
  }
}

}  // namespace pmeta
