#include "pmeta_core/base/csv_table.h"

#include <zlib.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <iterator>
#include <limits>
#include <memory>
#include <unordered_set>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/file.h"
#include "pmeta_core/base/format.h"
#include "pmeta_core/base/number.h"

namespace pmeta {
namespace {

// a few cells of one character each take thirty times as much
constexpr std::size_t kLargestTable = std::size_t{1} << 26;

// zlib also reads plain files
std::string readWhole(const std::string& path) {
  const auto fail = [&](const std::string& why) -> std::string {
    throw Error("cannot read " + path + " (" + why + ").");
  };
  requireRegularFile(path, "the table");
  errno = 0;
  const gzFile opened = gzopen(path.c_str(), "rb");
  if (opened == nullptr) return fail(errno == 0 ? "out of memory" : std::strerror(errno));
  const std::unique_ptr<gzFile_s, int (*)(gzFile)> file(opened, gzclose);
  std::string text;
  std::vector<char> buffer(1 << 16);
  int got = 0;
  while ((got = gzread(file.get(), buffer.data(), static_cast<unsigned>(buffer.size()))) > 0) {
    text.append(buffer.data(), got);
    if (text.size() > kLargestTable) {
      return fail("it has more than " + std::to_string(kLargestTable) +
                  " bytes when unpacked, and at most that is read");
    }
  }
  int code = Z_OK;
  const std::string why = gzerror(file.get(), &code);
  if (code == Z_BUF_ERROR) return fail("its compressed data ends too early: is it cut short?");
  if (code == Z_ERRNO) return fail(std::strerror(errno));
  if (code != Z_OK && code != Z_STREAM_END) return fail("its compressed data is damaged: " + why);
  return text;
}

std::vector<std::string> splitLine(const std::string& line) {
  std::vector<std::string> cells(1);
  for (const char c : line) {
    if (c == ',') {
      cells.emplace_back();
    } else {
      cells.back() += c;
    }
  }
  return cells;
}

std::string place(const std::string& source, long line) {
  return source + " line " + std::to_string(line);
}

std::string rangeSuffix(const Range& range) {
  const std::string text = range.text();
  return text == "any" ? "" : ", " + text;
}

}  // namespace

CsvTable CsvTable::load(const std::string& path) { return parse(readWhole(path), path); }

CsvTable CsvTable::parse(const std::string& text, const std::string& source) {
  CsvTable table;
  table.source_ = source;
  if (text.empty()) throw Error(source + " is empty: its first line must name the columns.");
  long line_number = 0;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    std::string line = text.substr(begin, end - begin);
    if (!line.empty() && line.back() == '\r') line.pop_back();
    table.addRow(splitLine(line), ++line_number);
    begin = end + 1;
  }
  return table;
}

void CsvTable::addRow(std::vector<std::string> cells, long line) {
  if (line == 1) {
    std::unordered_set<std::string> names;
    for (const std::string& name : cells) {
      if (name.empty()) throw Error(place(source_, line) + " has a column without a name.");
      if (!names.insert(name).second) {
        throw Error(place(source_, line) + " names the column " + shown(name) + " twice.");
      }
    }
    columns_ = std::move(cells);
    return;
  }
  if (cells.size() != columns_.size()) {
    // the first column that is missing, or the last there is
    const std::size_t column = std::min(cells.size(), columns_.size() - 1);
    throw Error(place(source_, line) + " has " + std::to_string(cells.size()) + " cells for " +
                std::to_string(columns_.size()) + " columns" +
                (cells.size() < columns_.size() ? ": it ends before column "
                                                : ": it goes on after column ") +
                shown(columns_[column]) + ".");
  }
  cells_.insert(cells_.end(), std::make_move_iterator(cells.begin()),
                std::make_move_iterator(cells.end()));
}

std::size_t CsvTable::column(const std::string& name) const {
  const auto found = std::find(columns_.begin(), columns_.end(), name);
  if (found == columns_.end()) {
    throw Error(place(source_, 1) + " names no column '" + name +
                "': is this the right kind of file?");
  }
  return static_cast<std::size_t>(found - columns_.begin());
}

const std::string& CsvTable::text(std::size_t row, std::size_t column) const {
  return cells_[row * columns_.size() + column];
}

double CsvTable::number(std::size_t row, std::size_t column, const Range& range) const {
  double value = 0;
  if (!parseNumber(text(row, column), value) || !range.contains(value)) {
    refuse(row, column, "a number" + rangeSuffix(range));
  }
  return value;
}

int CsvTable::wholeNumber(std::size_t row, std::size_t column, const Range& range) const {
  double value = 0;
  if (!parseNumber(text(row, column), value) || !range.contains(value) ||
      value != std::floor(value) || std::abs(value) > std::numeric_limits<int>::max()) {
    refuse(row, column, "a whole number" + rangeSuffix(range));
  }
  return static_cast<int>(value);
}

void CsvTable::refuse(std::size_t row, std::size_t column, const std::string& allowed) const {
  throw Error(place(source_, line(row)) + " column " + columns_[column] + " is " +
              shown(text(row, column)) + " but must be " + allowed + ".");
}

}  // namespace pmeta
