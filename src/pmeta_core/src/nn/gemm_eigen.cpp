#include <Eigen/Core>

#include "pmeta_core/nn/gemm.h"

#define PMETA_TEXT_OF(x) #x
#define PMETA_TEXT(x) PMETA_TEXT_OF(x)

namespace pmeta {
namespace {

using RowMajor = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Stride = Eigen::OuterStride<>;
using Matrix = Eigen::Map<RowMajor, Eigen::Unaligned, Stride>;
using ConstMatrix = Eigen::Map<const RowMajor, Eigen::Unaligned, Stride>;

ConstMatrix factor(Transpose transpose, const float* data, std::size_t rows, std::size_t columns,
                   std::size_t stride) {
  const bool as_is = transpose == Transpose::kNo;
  return {data, static_cast<Eigen::Index>(as_is ? rows : columns),
          static_cast<Eigen::Index>(as_is ? columns : rows),
          Stride(static_cast<Eigen::Index>(stride))};
}

// Eigen cuts its factors into blocks that fit the caches it finds, and so sums in another order on
// another processor; these are told it instead
void fixBlocks() {
  static const bool kFixed = (Eigen::setCpuCacheSizes(32 << 10, 512 << 10, 4 << 20), true);
  static_cast<void>(kFixed);
}

template <class A, class B>
void multiply(float alpha, const A& a, const B& b, float beta, Matrix& c) {
  if (beta == 0) {
    c.noalias() = alpha * a * b;
    return;
  }
  if (beta != 1) c *= beta;
  c.noalias() += alpha * a * b;
}

}  // namespace

void gemmEigen(Transpose transpose_a, Transpose transpose_b, std::size_t m, std::size_t n,
               std::size_t k, float alpha, const float* a, std::size_t lda, const float* b,
               std::size_t ldb, float beta, float* c, std::size_t ldc) {
  fixBlocks();
  const ConstMatrix left = factor(transpose_a, a, m, k, lda);
  const ConstMatrix right = factor(transpose_b, b, k, n, ldb);
  Matrix product(c, static_cast<Eigen::Index>(m), static_cast<Eigen::Index>(n),
                 Stride(static_cast<Eigen::Index>(ldc)));
  const bool plain_a = transpose_a == Transpose::kNo, plain_b = transpose_b == Transpose::kNo;
  if (plain_a && plain_b) multiply(alpha, left, right, beta, product);
  if (plain_a && !plain_b) multiply(alpha, left, right.transpose(), beta, product);
  if (!plain_a && plain_b) multiply(alpha, left.transpose(), right, beta, product);
  if (!plain_a && !plain_b) multiply(alpha, left.transpose(), right.transpose(), beta, product);
}

#ifndef PMETA_ONEDNN
void gemm(Transpose transpose_a, Transpose transpose_b, std::size_t m, std::size_t n, std::size_t k,
          float alpha, const float* a, std::size_t lda, const float* b, std::size_t ldb, float beta,
          float* c, std::size_t ldc) {
  gemmEigen(transpose_a, transpose_b, m, n, k, alpha, a, lda, b, ldb, beta, c, ldc);
}

std::string gemmName() {
  return "Eigen " PMETA_TEXT(EIGEN_WORLD_VERSION) "." PMETA_TEXT(
      EIGEN_MAJOR_VERSION) "." PMETA_TEXT(EIGEN_MINOR_VERSION);
}
#endif

}  // namespace pmeta
