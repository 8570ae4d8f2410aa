#pragma once

#include <clocale>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "support.h"

namespace pmeta::test {

/// Until the end of the scope the process's locale writes 0,5 for a half, as Qt's programs may have
/// it. available() is false where it cannot be compiled.
class GermanLocale {
 public:
  GermanLocale() : before_(std::setlocale(LC_ALL, nullptr)) {
    const std::string compile =
        "localedef -i de_DE -f UTF-8 " + dir_ / "de_DE.UTF-8" + " > /dev/null 2>&1";
    if (std::system(compile.c_str()) != 0) return;
    const ScopedVariable path("LOCPATH", dir_.path().c_str());
    if (std::setlocale(LC_ALL, "de_DE.UTF-8") == nullptr) return;
    char text[8];
    std::snprintf(text, sizeof text, "%.1f", 0.5);
    available_ = std::string(text) == "0,5";
  }
  ~GermanLocale() { std::setlocale(LC_ALL, before_.c_str()); }
  GermanLocale(const GermanLocale&) = delete;
  GermanLocale& operator=(const GermanLocale&) = delete;

  bool available() const { return available_; }

 private:
  TempDir dir_;
  std::string before_;
  bool available_ = false;
};

}  // namespace pmeta::test
