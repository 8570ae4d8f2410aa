#pragma once

#include <cstddef>

namespace pmeta::test {

/// How often this program has called operator new so far; allocations_test.cpp counts. What C
/// libraries take from malloc is not in it (oneDNN: one scratch block for each matrix product).
std::size_t allocations();

}  // namespace pmeta::test
