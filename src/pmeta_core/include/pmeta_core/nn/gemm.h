#pragma once

#include <cstddef>
#include <string>

namespace pmeta {

/// Whether a factor of a product is taken as it lies in memory or transposed.
enum class Transpose : char { kNo = 'N', kYes = 'T' };

/// C <- alpha * op(A) op(B) + beta * C on row-major matrices, by oneDNN or, where the build has
/// none (PMETA_GEMM=eigen), by Eigen. No signal is delivered to the thread meanwhile.
///
/// op(A) is [m, k], op(B) [k, n] and C [m, n]. `lda`, `ldb`, `ldc`: floats from one row in memory
/// to the next, at least the length of that row. With beta = 0, C is written without being read. C
/// may not overlap A or B. Runs on the calling thread alone, and one call gives the same bits every
/// time on one machine.
void gemm(Transpose transpose_a, Transpose transpose_b, std::size_t m, std::size_t n, std::size_t k,
          float alpha, const float* a, std::size_t lda, const float* b, std::size_t ldb, float beta,
          float* c, std::size_t ldc);

/// What gemm() runs on, for manifests: "oneDNN 2.6.3 (AVX2)", with the instruction set that oneDNN
/// uses here, or "Eigen 3.4.0".
std::string gemmName();

/// The same product by Eigen, in every build: slower, but with the same bits on every processor,
/// since it is compiled for the plain instruction set and does not ask for the sizes of caches.
void gemmEigen(Transpose transpose_a, Transpose transpose_b, std::size_t m, std::size_t n,
               std::size_t k, float alpha, const float* a, std::size_t lda, const float* b,
               std::size_t ldb, float beta, float* c, std::size_t ldc);

}  // namespace pmeta
