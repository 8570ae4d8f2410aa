#include "fuzz_support.h"
#include "pmeta_core/base/csv_table.h"
#include "pmeta_core/base/error.h"
#include "targets.h"

namespace pmeta::fuzz {
namespace {

template <class Call>
void tryTo(Call&& call) {
  try {
    call();
  } catch (const Error&) {
  }
}

}  // namespace

// a table as a file, plain or compressed; every cell as every type
void fuzzCsv(const std::uint8_t* data, std::size_t size) {
  const MemoryFile file(data, size);
  tryTo([&] {
    const CsvTable table = CsvTable::load(file.path());
    for (std::size_t column = 0; column < table.columns().size(); ++column) {
      require(table.column(table.columns()[column]) == column, "a column is not found by its name");
      for (std::size_t row = 0; row < table.numRows(); ++row) {
        tryTo([&] { table.number(row, column); });
        tryTo([&] { table.wholeNumber(row, column); });
      }
    }
  });
}

}  // namespace pmeta::fuzz
