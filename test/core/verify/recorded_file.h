#pragma once

#include <functional>
#include <string>
#include <vector>

#include "../support.h"
#include "pmeta_core/base/csv_table.h"

namespace pmeta::test {

/// The lines of a recorded file as cells; [0] is the header, so that line n of the file is [n - 1].
using Lines = std::vector<std::vector<std::string>>;

inline Lines linesOf(const std::string& path) {
  const CsvTable table = CsvTable::load(path);
  Lines lines = {table.columns()};
  for (std::size_t row = 0; row < table.numRows(); ++row) {
    lines.emplace_back();
    for (std::size_t column = 0; column < table.columns().size(); ++column) {
      lines.back().push_back(table.text(row, column));
    }
  }
  return lines;
}

inline std::string textOf(const Lines& lines) {
  std::string text;
  for (const auto& cells : lines) text += join(cells, ",") + "\n";
  return text;
}

/// A recorded file with one change, gone afterwards.
class Altered {
 public:
  Altered(const std::string& path, const std::function<void(Lines&)>& change)
      : path_(dir_ / "altered.csv") {
    Lines lines = linesOf(path);
    change(lines);
    writeFile(path_, textOf(lines));
  }
  const std::string& path() const { return path_; }

 private:
  TempDir dir_;
  std::string path_;
};

}  // namespace pmeta::test
