#include "pmeta_core/base/format.h"

#include <array>
#include <cmath>
#include <locale>
#include <sstream>

namespace pmeta {
namespace {

std::string fixed(double value, int decimals) {
  std::ostringstream text;
  text.imbue(std::locale::classic());
  text.precision(decimals);
  text << std::fixed << value;
  return text.str();
}

std::string twoDigits(long value) {
  return value < 10 ? "0" + std::to_string(value) : std::to_string(value);
}

}  // namespace

std::string shortNumber(double value) {
  if (!std::isfinite(value)) return "-";
  if (std::abs(value) >= 1e5) return significant(value, 3);
  const std::string text = fixed(value, 2);
  return text == "-0.00" ? "0.00" : text;
}

std::string significant(double value, int digits) {
  if (std::isnan(value)) return "-";
  std::ostringstream text;
  text.imbue(std::locale::classic());
  text.precision(digits);
  text << value;
  return text.str();
}

std::string shortCount(double value) {
  if (!std::isfinite(value)) return "-";
  constexpr std::array<const char*, 4> kUnits = {"", "k", "M", "G"};
  std::size_t unit = 0;
  // 999.5 would be rounded to 1e+03
  for (; std::abs(value) >= 999.5 && unit + 1 < kUnits.size(); ++unit) value /= 1000;
  return significant(value, 3) + kUnits[unit];
}

std::string duration(double seconds) {
  if (!std::isfinite(seconds)) return "-";
  if (seconds < 10) return fixed(seconds, 1) + " s";
  const long whole = std::lround(seconds);
  if (whole < 3600) return std::to_string(whole / 60) + ":" + twoDigits(whole % 60) + " min";
  return std::to_string(whole / 3600) + ":" + twoDigits(whole / 60 % 60) + " h";
}

std::string padded(const std::string& text, std::size_t width, bool right) {
  const std::string blanks(text.size() < width ? width - text.size() : 0, ' ');
  return right ? blanks + text : text + blanks;
}

}  // namespace pmeta
