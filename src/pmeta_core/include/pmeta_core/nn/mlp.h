#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "pmeta_core/base/model.h"
#include "pmeta_core/base/rng.h"
#include "pmeta_core/nn/aligned.h"
#include "pmeta_core/nn/gemm.h"

namespace pmeta {

/// Of hidden units.
enum class Activation { kRelu, kTanh };

/// Sizes of a multi-layer perceptron with a linear output.
struct MlpSpec {
  std::string prefix;               ///< first part of its block names, e.g. "q"
  std::size_t inputs = 0;           ///< positive
  std::vector<std::size_t> hidden;  ///< units of each hidden layer, all positive; may be empty
  std::size_t outputs = 0;          ///< positive
  bool dueling = false;             ///< two heads, Q = V + A - mean A (Wang et al., 2016, eq. 9)
  bool portable = false;            ///< products by gemmEigen: the same bits on every processor
  Activation activation = Activation::kRelu;  ///< of hidden layers
  /// Last layers; not with `dueling`. With several, the output is the sum of theirs, weighted by
  /// the inputs [head_input, head_input + heads), which are inputs of the first layer as well: a
  /// one-hot vector there chooses.
  std::size_t heads = 1;
  std::size_t head_input = 0;  ///< see heads
};

/// Of a network with ReLU and `hidden` as settings have it: units of each hidden layer.
MlpSpec mlpSpec(std::string prefix, std::size_t inputs, const std::vector<int>& hidden,
                std::size_t outputs, bool portable);

class Mlp;

/// Room for one pass through an Mlp, forward and back. Nothing is allocated after construction.
/// backward() reads what the last forward() left here: networks that are alive at the same time,
/// such as a network and its target, need one workspace each.
class MlpWorkspace {
 public:
  /// For batches of up to `max_batch` (at least 1) rows.
  MlpWorkspace(const Mlp& mlp, std::size_t max_batch);

  std::size_t maxBatch() const { return max_batch_; }  ///< rows that it has room for

 private:
  friend class Mlp;

  std::size_t max_batch_;
  std::vector<AlignedFloats> activations_;  // output of each layer, the last one linear
  AlignedFloats outputs_;                   // heads combined, if there are several
  AlignedFloats head_weights_;              // of the last forward pass, if the input weighs them
  AlignedFloats delta_, next_delta_;        // gradients by a layer's output
};

/// A multi-layer perceptron over parameters that the caller owns as one flat vector.
///
/// Matrices are row-major with one sample a row: an input is [batch, inputs]. Weights lie as in
/// PyTorch, [out, in], and so are named: "q.layer0.weight", "q.layer0.bias", ... A dueling network
/// ends in "q.value.weight" [1, h], "q.advantage.weight" [outputs, h], "q.value.bias" and
/// "q.advantage.bias" in the place of its last layer; of several heads that layer's rows are head
/// 0's, then head 1's, and so on. Parameters need no alignment, but 64 bytes (AlignedFloats) are
/// faster.
class Mlp {
 public:
  /// Throws Error unless every size is positive, the prefix a name and the heads' weights inputs.
  explicit Mlp(MlpSpec spec);

  const MlpSpec& spec() const { return spec_; }          ///< as given to the constructor
  std::size_t inputs() const { return spec_.inputs; }    ///< length of an input row
  std::size_t outputs() const { return spec_.outputs; }  ///< length of an output row
  std::size_t size() const { return size_; }             ///< number of parameters

  /// Names and shapes of the parameters in their order, for a ModelLayout of Precision::kFloat32.
  const std::vector<Block>& blocks() const { return blocks_; }

  /// Draws weights and biases from U(-b, b), b = 1 / sqrt(inputs of the layer): torch.nn.Linear's
  /// default.
  void initialise(float* parameters, Rng& rng) const;

  /// Outputs [batch, outputs] of `input` [batch, inputs]. They lie in the workspace until its next
  /// forward pass. Throws Error if the batch is larger than the workspace.
  const float* forward(const float* parameters, const float* input, std::size_t batch,
                       MlpWorkspace& workspace) const;

  /// Gradients of a loss whose gradient by the outputs is `d_output` [batch, outputs], summed over
  /// the batch: by the parameters into `gradient` (overwritten, in the parameters' order), and by
  /// the input into `d_input` [batch, inputs] unless that is null. Parameters and input must be
  /// those of the workspace's last forward pass; `batch` may be less: the first rows of that pass.
  void backward(const float* parameters, const float* input, std::size_t batch,
                const float* d_output, float* gradient, float* d_input,
                MlpWorkspace& workspace) const;

  /// The same, with the gradient by the inputs [first, first + count) alone, into `d_input` [batch,
  /// count].
  void backward(const float* parameters, const float* input, std::size_t batch,
                const float* d_output, float* gradient, std::size_t first, std::size_t count,
                float* d_input, MlpWorkspace& workspace) const;

  /// Gradient by the inputs [first, first + count) alone, into `d_input` [batch, count], with the
  /// parameters frozen: how an actor sees its critic. Saves more than half of backward(). `rows`
  /// chooses which rows of the last forward pass these are (`batch` of them; null: the first).
  void backwardInput(const float* parameters, std::size_t batch, const float* d_output,
                     std::size_t first, std::size_t count, float* d_input, MlpWorkspace& workspace,
                     const std::size_t* rows = nullptr) const;

 private:
  friend class MlpWorkspace;

  // weights [outputs, inputs] at `weight` of the flat vector, biases at `bias`
  struct Layer {
    std::size_t inputs, outputs, weight, bias;
  };

  void backwardThrough(const float* parameters, const float* input, std::size_t batch,
                       const float* d_output, float* gradient, std::size_t first, std::size_t count,
                       const std::size_t* rows, float* d_input, MlpWorkspace& workspace) const;
  void requireInputs(std::size_t first, std::size_t count) const;
  const float* combine(const float* input, std::size_t batch, MlpWorkspace& workspace) const;
  const float* split(const float* d_output, std::size_t batch, const std::size_t* rows,
                     MlpWorkspace& workspace) const;
  void addWeighing(const float* d_output, std::size_t batch, const std::size_t* rows,
                   std::size_t first, std::size_t count, float* d_input,
                   const MlpWorkspace& workspace) const;

  MlpSpec spec_;
  decltype(&gemm) product_;
  std::vector<Layer> layers_;  // a dueling network's heads are one layer of 1 + outputs
  std::vector<Block> blocks_;
  std::size_t size_ = 0;
};

}  // namespace pmeta
