#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "pmeta_core/base/settings.h"

namespace pmeta {

/// A comma-separated file with one header line and no quotes, held as text cells.
///
/// Every failure throws Error with one sentence that names the file, the line and the column.
class CsvTable {
 public:
  /// Reads a file, plain or compressed by gzip. Refuses one that cannot be read to its end, that
  /// has no header, or a row with more or fewer cells than the header.
  static CsvTable load(const std::string& path);

  /// The same from text; `source` names it in errors.
  static CsvTable parse(const std::string& text, const std::string& source);

  /// The header's names, in the order of the file.
  const std::vector<std::string>& columns() const { return columns_; }
  /// Lines after the header.
  std::size_t numRows() const { return cells_.size() / columns_.size(); }

  /// The index of the column of that name; throws Error if there is none.
  std::size_t column(const std::string& name) const;

  /// A cell as it stands in the file; `row` and `column` count from 0 and must exist.
  const std::string& text(std::size_t row, std::size_t column) const;

  /// A cell as a finite number in `range`; throws Error if it is none.
  double number(std::size_t row, std::size_t column, const Range& range = {}) const;

  /// A cell as a whole number in `range`; throws Error if it is none.
  int wholeNumber(std::size_t row, std::size_t column, const Range& range = {}) const;

  /// The line of the file that holds `row`, counted from 1, the header's.
  long line(std::size_t row) const { return static_cast<long>(row) + 2; }

  /// Throws Error: the cell, its place and what it must be, e.g. "a number".
  [[noreturn]] void refuse(std::size_t row, std::size_t column, const std::string& allowed) const;

 private:
  void addRow(std::vector<std::string> cells, long line);

  std::string source_;
  std::vector<std::string> columns_;
  std::vector<std::string> cells_;  ///< row after row
};

}  // namespace pmeta
