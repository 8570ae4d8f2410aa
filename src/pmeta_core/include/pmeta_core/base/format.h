#pragma once

#include <cstddef>
#include <string>

namespace pmeta {

// Numbers as people read them, with dots whatever the locale is: Qt, for one, sets the C locale
// from the environment. What a program reads back is written by formatNumber().

/// Two decimals, or three significant digits from 1e5 on; "-" where there is no number.
std::string shortNumber(double value);

/// So many significant digits, as printf's %g; "-" for NaN.
std::string significant(double value, int digits);

/// Three significant digits with k, M or G for thousands, millions and billions, e.g. "12.3k"; "-"
/// where there is no number.
std::string shortCount(double value);

/// Hours, minutes and seconds, "0:01:05"; "-" where there is no number. Not of negative numbers.
std::string duration(double seconds);

/// Is it UTF-8 without control characters, as names must be?
bool isPlainText(const std::string& text);

/// A text of unknown origin, fit to be shown: in quotes, cut after 60 bytes (never within a UTF-8
/// character), with a ? for each control character and each byte that is not UTF-8.
std::string shown(const std::string& text);

/// The same without quotes, and cut after `most` bytes: for a whole sentence of unknown origin.
std::string plain(const std::string& text, std::size_t most);

/// The text with blanks up to `width` after it, or before it if `right`.
std::string padded(const std::string& text, std::size_t width, bool right = false);

}  // namespace pmeta
