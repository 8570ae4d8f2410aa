#include <dnnl.h>
#include <omp.h>

#include <string>

#include "pmeta_core/base/error.h"
#include "pmeta_core/nn/gemm.h"
#include "pmeta_core/nn/held_signals.h"

#if DNNL_CPU_RUNTIME != DNNL_RUNTIME_OMP && DNNL_CPU_RUNTIME != DNNL_RUNTIME_SEQ
#error "pMeta holds oneDNN to one thread through OpenMP; this oneDNN is built for another runtime."
#endif

namespace pmeta {
namespace {

// oneDNN asks OpenMP how many threads to use; told one, it calls its kernel directly and OpenMP
// starts none. Only this thread's setting changes, and only until the end of the scope.
class OneThread {
 public:
  OneThread() : before_(omp_get_max_threads()) {
    if (before_ != 1) omp_set_num_threads(1);
  }
  ~OneThread() {
    if (before_ != 1) omp_set_num_threads(before_);
  }
  OneThread(const OneThread&) = delete;
  OneThread& operator=(const OneThread&) = delete;

 private:
  int before_;
};

}  // namespace

void gemm(Transpose transpose_a, Transpose transpose_b, std::size_t m, std::size_t n, std::size_t k,
          float alpha, const float* a, std::size_t lda, const float* b, std::size_t ldb, float beta,
          float* c, std::size_t ldc) {
  if (m == 0 || n == 0) return;
  const auto size = [](std::size_t x) { return static_cast<dnnl_dim_t>(x); };
  const OneThread one_thread;
  const HeldSignals held_signals;
  const dnnl_status_t status =
      dnnl_sgemm(static_cast<char>(transpose_a), static_cast<char>(transpose_b), size(m), size(n),
                 size(k), alpha, a, size(lda), b, size(ldb), beta, c, size(ldc));
  if (status != dnnl_success) {
    throw Error("oneDNN refused a matrix product (status " + std::to_string(status) +
                "); check the sizes, or build with -DPMETA_GEMM=eigen.");
  }
}

std::string gemmName() {
  const dnnl_version_t* version = dnnl_version();
  std::string name = "oneDNN " + std::to_string(version->major) + "." +
                     std::to_string(version->minor) + "." + std::to_string(version->patch);
#if DNNL_VERSION_MAJOR >= 2
  // each holds the bits of those that it extends
  const auto isa = static_cast<unsigned>(dnnl_get_effective_cpu_isa());
  const auto has = [isa](dnnl_cpu_isa_t set) { return (isa & set) == static_cast<unsigned>(set); };
  name += has(dnnl_cpu_isa_avx512_core) ? " (AVX-512)"
          : has(dnnl_cpu_isa_avx2)      ? " (AVX2)"
          : has(dnnl_cpu_isa_avx)       ? " (AVX)"
                                        : " (SSE4.1)";
#endif
  return name;
}

}  // namespace pmeta
