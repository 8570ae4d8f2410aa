#pragma once

#include <locale.h>

#include <string>

namespace pmeta {

/// Until the end of the scope, C's functions write and read this thread's numbers with dots. Qt,
/// for one, sets the process's locale from the environment, and there they may be commas.
class NumbersWithDots {
 public:
  NumbersWithDots();
  ~NumbersWithDots();
  NumbersWithDots(const NumbersWithDots&) = delete;
  NumbersWithDots& operator=(const NumbersWithDots&) = delete;

 private:
  locale_t before_;
};

/// Is the whole text a finite decimal number, e.g. "-1.5e3", whatever the locale is? Words, blanks
/// and hexadecimal digits are none.
bool parseNumber(const std::string& text, double& value);

}  // namespace pmeta
