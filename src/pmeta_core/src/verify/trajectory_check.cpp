#include "pmeta_core/verify/trajectory_check.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "pmeta_core/base/csv_table.h"
#include "pmeta_core/base/error.h"
#include "pmeta_core/base/format.h"

namespace pmeta {
namespace {

// one row of a trajectory file
struct Row {
  long line = 0;
  int task = 0;
  int seq = 0;
  int t = 0;
  bool ended = false;  ///< this row, or one before it in its sequence, is terminal
  std::vector<double> inputs;
  std::vector<double> state;
  std::vector<double> compared;
};

// reads rows in order and sees to it that sequences are whole
class RowReader {
 public:
  RowReader(const CsvTable& table, const TrajectoryColumns& columns, int num_tasks)
      : table_(table),
        columns_(columns),
        num_tasks_(num_tasks),
        seq_(table.column("seq")),
        t_(table.column("t")),
        done_(table.column("done")),
        inputs_(indices(columns.inputs)),
        state_(indices(columns.state)),
        compared_(indices(columns.compared)) {
    if (columns.has_task) task_ = table.column("task");
  }

  /// Reads the row after `before`; the first is read with nullptr.
  Row read(std::size_t row, const Row* before) const {
    Row result;
    result.line = table_.line(row);
    if (columns_.has_task) {
      result.task = table_.wholeNumber(row, task_, Range::between(0, num_tasks_ - 1));
    }
    result.seq = table_.wholeNumber(row, seq_);
    result.t = table_.wholeNumber(row, t_);
    const bool goes_on =
        before != nullptr && before->task == result.task && before->seq == result.seq;
    const int expected = goes_on ? before->t + 1 : 0;
    if (result.t != expected) {
      table_.refuse(row, t_,
                    std::to_string(expected) +
                        (goes_on ? ", the step after the row before" : " where a sequence begins"));
    }
    const bool done = table_.wholeNumber(row, done_, Range::between(0, 1)) == 1;
    result.ended = goes_on && (before->ended || done);
    result.inputs = numbers(row, inputs_);
    result.state = numbers(row, state_);
    result.compared = numbers(row, compared_);
    if (columns_.num_actions > 0 && result.t > 0) {
      table_.wholeNumber(row, inputs_.front(), Range::between(0, columns_.num_actions - 1));
    }
    return result;
  }

 private:
  std::vector<std::size_t> indices(const std::vector<std::string>& names) const {
    std::vector<std::size_t> found;
    for (const std::string& name : names) found.push_back(table_.column(name));
    return found;
  }

  std::vector<double> numbers(std::size_t row, const std::vector<std::size_t>& columns) const {
    std::vector<double> values;
    for (const std::size_t column : columns) values.push_back(table_.number(row, column));
    return values;
  }

  const CsvTable& table_;
  const TrajectoryColumns& columns_;
  int num_tasks_;
  std::size_t task_ = 0;
  std::size_t seq_;
  std::size_t t_;
  std::size_t done_;
  std::vector<std::size_t> inputs_;
  std::vector<std::size_t> state_;
  std::vector<std::size_t> compared_;
};

void raise(LargestError& largest, double error, long line) {
  if (error > largest.value) largest = {error, line};
}

// simulates the step that ends in `row` and enters what it finds
void compareStep(TrajectorySimulator& simulator, ReplayMode mode, const Row& row,
                 TrajectoryReport& report) {
  std::vector<double> simulated(row.compared.size());
  simulator.step(row.inputs.data(), simulated.data());
  bool unbounded = false;
  for (std::size_t i = 0; i < simulated.size(); ++i) {
    const double tolerance = simulator.tolerance(mode, row.task, row.t, i, row.compared[i]);
    // a simulation that is not finite is never right
    const double error = std::isfinite(simulated[i]) ? std::abs(simulated[i] - row.compared[i])
                                                     : std::numeric_limits<double>::infinity();
    const bool free = std::isinf(tolerance);
    unbounded = unbounded || free;
    ColumnErrors& column = report.columns[i];
    raise(mode == ReplayMode::kSingleStep ? column.single_step
          : free                          ? column.unbounded
                                          : column.open_loop,
          error, row.line);
    if (error <= tolerance && std::isfinite(simulated[i])) continue;
    if (report.deviations++ == 0) {
      report.first = {mode,  row.line,        column.column, row.task, row.seq,
                      row.t, row.compared[i], simulated[i],  tolerance};
    }
  }
  if (unbounded && mode == ReplayMode::kOpenLoop) ++report.unbounded_steps;
}

// "3.1e-14 (line 71)"
std::string shown(const LargestError& error) {
  if (error.value == 0) return "0";
  return significant(error.value, 2) + " (line " + std::to_string(error.line) + ")";
}

std::string sentence(const Deviation& d) {
  return "line " + std::to_string(d.line) + ", column " + d.column + " (task " +
         std::to_string(d.task) + ", sequence " + std::to_string(d.seq) + ", t " +
         std::to_string(d.t) + "): recorded " + formatNumber(d.recorded) + ", simulated " +
         formatNumber(d.simulated) +
         (d.mode == ReplayMode::kSingleStep ? " from the row before"
                                            : " from the sequence's start") +
         ", tolerance " + significant(d.tolerance, 2);
}

}  // namespace

TrajectoryReport checkTrajectories(const std::string& kind, const std::string& path,
                                   const std::string& tasks_file) {
  // one for each mode: a simulator may remember more than its state
  const auto single = makeTrajectorySimulator(kind, tasks_file);
  const auto open = makeTrajectorySimulator(kind, tasks_file);
  const CsvTable table = CsvTable::load(path);
  const RowReader reader(table, single->columns(), single->numTasks());
  if (table.numRows() == 0) throw Error(path + " holds no rows, only a header.");

  TrajectoryReport report;
  report.kind = kind;
  report.path = path;
  for (const std::string& name : single->columns().compared) {
    report.columns.emplace_back();
    report.columns.back().column = name;
  }
  Row before;
  for (std::size_t i = 0; i < table.numRows(); ++i) {
    Row row = reader.read(i, i == 0 ? nullptr : &before);
    if (row.t == 0) {
      open->start(row.task, row.state.data(), row.ended);
      ++report.sequences;
    } else {
      single->start(before.task, before.state.data(), before.ended);
      compareStep(*single, ReplayMode::kSingleStep, row, report);
      compareStep(*open, ReplayMode::kOpenLoop, row, report);
      ++report.steps;
    }
    before = std::move(row);
  }
  return report;
}

std::string trajectoryTable(const TrajectoryReport& report) {
  const bool beyond = report.unbounded_steps > 0;
  const std::size_t width = 24;
  std::size_t name_width = 16;
  for (const ColumnErrors& c : report.columns) {
    name_width = std::max(name_width, c.column.size() + 2);
  }
  std::string text = report.path + ": " + std::to_string(report.sequences) + " sequences, " +
                     std::to_string(report.steps) + " steps\nlargest error\n";
  const auto line = [&](const std::string& name, const std::string& single, const std::string& open,
                        const std::string& unbounded) {
    text += "  " + padded(name, name_width) + padded(single, width) +
            (beyond ? padded(open, width) + unbounded : open) + "\n";
  };
  line("column", "single steps", "open loop",
       "later (" + std::to_string(report.unbounded_steps) + " steps without a tolerance)");
  for (const ColumnErrors& c : report.columns) {
    line(c.column, shown(c.single_step), shown(c.open_loop), shown(c.unbounded));
  }
  if (report.ok()) return text + "ok: every number lies within its tolerance\n";
  return text + "NOT ok: " + std::to_string(report.deviations) +
         " numbers lie beyond their tolerance, first " + sentence(*report.first) + "\n";
}

}  // namespace pmeta
