#include "pmeta_core/base/number.h"

#include <cmath>
#include <cstdlib>

namespace pmeta {
namespace {

locale_t plainLocale() {
  static const locale_t kPlain = ::newlocale(LC_ALL_MASK, "C", nullptr);
  return kPlain;
}

}  // namespace

NumbersWithDots::NumbersWithDots() : before_(::uselocale(plainLocale())) {}
NumbersWithDots::~NumbersWithDots() { ::uselocale(before_); }

bool parseNumber(const std::string& text, double& value) {
  if (text.empty() || text.find_first_not_of("0123456789+-.eE") != std::string::npos) return false;
  const NumbersWithDots dots;
  char* end = nullptr;
  value = std::strtod(text.c_str(), &end);
  return end == text.c_str() + text.size() && std::isfinite(value);
}

}  // namespace pmeta
