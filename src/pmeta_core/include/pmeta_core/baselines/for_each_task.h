#pragma once

#include <cstddef>
#include <functional>

namespace pmeta {

/// Calls work(0), ..., work(count - 1), on up to `threads` threads at the same time; each must
/// touch what is its own alone. If some throw, the exception of the lowest is thrown in the end.
void forEachTask(std::size_t count, int threads, const std::function<void(std::size_t)>& work);

}  // namespace pmeta
