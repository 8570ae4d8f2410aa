#pragma once

#include <stdexcept>
#include <string>

namespace pmeta {

/// What a user can mend: one sentence that says what was given, what is allowed and what to do.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace pmeta
