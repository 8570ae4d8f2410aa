#pragma once

// one binary, the widest vectors of the machine it runs on; contraction is off, so all give equal
// bits
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_THREAD__) && !defined(__SANITIZE_ADDRESS__)
#define PMETA_VECTORISED __attribute__((target_clones("default", "avx2", "avx512f")))
#else
#define PMETA_VECTORISED
#endif
