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

constexpr std::size_t kMostShown = 60;  // bytes

// length of the UTF-8 character that begins at `at`; 0 if there is none (RFC 3629)
std::size_t characterLength(const std::string& text, std::size_t at) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned char first = byte(at);
  if (first < 0x80) return 1;
  const std::size_t length = first >= 0xf0 ? 4 : first >= 0xe0 ? 3 : 2;
  if (first < 0xc2 || first > 0xf4 || at + length > text.size()) return 0;
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(at + i) & 0xc0) != 0x80) return 0;
  }
  // forms that are too long, surrogates, and what is beyond U+10FFFF
  const unsigned char second = byte(at + 1);
  if ((first == 0xe0 && second < 0xa0) || (first == 0xed && second > 0x9f) ||
      (first == 0xf0 && second < 0x90) || (first == 0xf4 && second > 0x8f)) {
    return 0;
  }
  return length;
}

// C0 and C1 control characters: a terminal obeys both
bool isControl(const std::string& text, std::size_t at, std::size_t length) {
  const auto byte = static_cast<unsigned char>(text[at]);
  if (length == 1) return byte < 0x20 || byte == 0x7f;
  return byte == 0xc2 && static_cast<unsigned char>(text[at + 1]) < 0xa0;
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
  const long whole = std::lround(seconds);
  return std::to_string(whole / 3600) + ":" + twoDigits(whole / 60 % 60) + ":" +
         twoDigits(whole % 60);
}

bool isPlainText(const std::string& text) {
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t length = characterLength(text, at);
    if (length == 0 || isControl(text, at, length)) return false;
    at += length;
  }
  return true;
}

std::string shown(const std::string& text) { return "'" + plain(text, kMostShown) + "'"; }

std::string plain(const std::string& text, std::size_t most) {
  std::string out;
  std::size_t at = 0;
  while (at < text.size()) {
    const std::size_t length = characterLength(text, at);
    const std::size_t taken = length == 0 ? 1 : length;
    if (at + taken > most) break;
    out += length == 0 || isControl(text, at, length) ? "?" : text.substr(at, length);
    at += taken;
  }
  return at < text.size() ? out + "..." : out;
}

std::string padded(const std::string& text, std::size_t width, bool right) {
  const std::string blanks(text.size() < width ? width - text.size() : 0, ' ');
  return right ? blanks + text : text + blanks;
}

}  // namespace pmeta
