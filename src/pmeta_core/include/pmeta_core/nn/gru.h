#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "pmeta_core/base/model.h"
#include "pmeta_core/nn/aligned.h"
#include "pmeta_core/nn/gemm.h"

namespace pmeta {

/// Sizes of a gated recurrent unit.
struct GruSpec {
  std::string prefix;      ///< first part of its block names, e.g. "gru"
  std::size_t inputs = 0;  ///< positive
  std::size_t units = 0;   ///< of the hidden state; positive
  bool portable = false;   ///< products by gemmEigen: the same bits on every processor
};

class Gru;

/// Room for one unroll, forward and back. Nothing is allocated after construction.
class GruWorkspace {
 public:
  /// For unrolls of up to `max_rows` steps, summed over all sequences, with up to `max_batch`
  /// sequences side by side.
  GruWorkspace(const Gru& gru, std::size_t max_rows, std::size_t max_batch);

 private:
  friend class Gru;

  std::size_t max_rows_, max_batch_;
  std::vector<std::size_t> batches_;  // of the last unroll
  // by step and sequence
  AlignedFloats gates_;       // n, r, z and what h gave to n; after backward() gradients by those
  AlignedFloats previous_;    // hidden state before the step
  AlignedFloats hidden_;      // and after it
  AlignedFloats transposed_;  // weight_hh
  // of one step
  AlignedFloats recurrent_;
  AlignedFloats carried_, next_carried_;  // gradients by the hidden state
  AlignedFloats sums_;
};

/// A gated recurrent unit (Cho et al., 2014), in the form of torch.nn.GRU with one layer: the reset
/// gate is applied after the hidden state's product,
///
///     r = sigmoid(W_ir x + b_ir + W_hr h + b_hr)       z = sigmoid(W_iz x + b_iz + W_hz h + b_hz)
///     n = tanh(W_in x + b_in + r (W_hn h + b_hn))      h' = (1 - z) n + z h
///
/// over parameters that the caller owns as one flat vector, in the order and the names of PyTorch:
/// "gru.weight_ih" [3 units, inputs] (the rows of r, z, n), "gru.weight_hh" [3 units, units],
/// "gru.bias_ih" and "gru.bias_hh" [3 units].
///
/// Sequences are unrolled side by side, the longest first: at step t the first batches[t] of them
/// go on, and batches never grows. Matrices have one row for each step of a sequence, those of one
/// step together in the sequences' order, with no rows where a sequence is over.
class Gru {
 public:
  /// Throws Error unless every size is positive and the prefix a name.
  explicit Gru(GruSpec spec);

  /// As it was made.
  const GruSpec& spec() const { return spec_; }
  /// Numbers of an input.
  std::size_t inputs() const { return spec_.inputs; }
  /// Numbers of a hidden state.
  std::size_t units() const { return spec_.units; }
  std::size_t size() const { return size_; }  ///< number of parameters

  /// Names and shapes of the parameters in their order, for a ModelLayout of Precision::kFloat32.
  const std::vector<Block>& blocks() const { return blocks_; }

  /// Hidden states after every step of `input` [rows, inputs]: [rows, units], in the workspace
  /// until its next unroll. They begin at `initial` [batches[0], units], or at 0 where that is
  /// null. Throws Error if `batches` does not fit the workspace, or grows.
  const float* unroll(const float* parameters, const float* input,
                      const std::vector<std::size_t>& batches, const float* initial,
                      GruWorkspace& workspace) const;

  /// One step of `batch` sequences: `hidden` [batch, units] moves on.
  void step(const float* parameters, const float* input, std::size_t batch, float* hidden,
            GruWorkspace& workspace) const;

  /// Backpropagation through time. Gradients of a loss whose gradient by the hidden states is
  /// `d_hidden` [rows, units], summed over all rows: by the parameters into `gradient`
  /// (overwritten, in their order); by the inputs into `d_input` [rows, inputs] and by the initial
  /// hidden states into `d_initial` [batches[0], units], unless those are null. Parameters and
  /// input must be those of the workspace's last unroll, which serves one call.
  void backward(const float* parameters, const float* input, const float* d_hidden, float* gradient,
                float* d_input, float* d_initial, GruWorkspace& workspace) const;

 private:
  void forward(const float* parameters, const float* input, const float* initial,
               Transpose recurrent, GruWorkspace& workspace) const;
  void backwardThroughTime(const float* parameters, const float* d_hidden,
                           GruWorkspace& workspace) const;
  void linear(const float* x, std::size_t rows, std::size_t inputs, Transpose transpose,
              const float* weight, const float* bias, std::size_t outputs, float* y,
              std::size_t stride) const;

  GruSpec spec_;
  decltype(&gemm) product_;
  std::vector<Block> blocks_;
  std::size_t weight_hh_, bias_ih_, bias_hh_;  // where they begin; weight_ih is first
  std::size_t size_;
};

}  // namespace pmeta
