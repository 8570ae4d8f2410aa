#include "pmeta_core/env/walker2d_tasks.h"

#include <mujoco/mujoco.h>

#include <cmath>

#include "pmeta_core/base/csv_table.h"
#include "pmeta_core/base/error.h"

namespace pmeta {
namespace {

// one of the fields that a task changes
struct Field {
  const char* name;
  const double* figures;  ///< of the base model
  int rows;
  int columns;
  std::vector<double> Walker2dTask::*factors;
};

std::vector<Field> fieldsOf(const mjModel* m) {
  return {{"body_mass", m->body_mass, m->nbody, 1, &Walker2dTask::body_mass},
          {"body_inertia", m->body_inertia, m->nbody, 3, &Walker2dTask::body_inertia},
          {"dof_damping", m->dof_damping, m->nv, 1, &Walker2dTask::dof_damping},
          {"geom_friction", m->geom_friction, m->ngeom, 3, &Walker2dTask::geom_friction}};
}

// reads one row after the other, each of which must be the one that is expected
class TaskReader {
 public:
  explicit TaskReader(const CsvTable& table)
      : table_(table),
        task_(table.column("task")),
        field_(table.column("field")),
        row_(table.column("row")),
        col_(table.column("col")),
        multiplier_(table.column("multiplier")),
        value_(table.column("value")) {}

  bool atEnd() const { return next_ == table_.numRows(); }

  double read(int task, const Field& field, int row, int col) {
    requireNumber(task_, task);
    if (table_.text(next_, field_) != field.name) table_.refuse(next_, field_, field.name);
    requireNumber(row_, row);
    requireNumber(col_, col);
    const double factor = table_.number(next_, multiplier_, Range::above(0));
    const double expected = field.figures[row * field.columns + col] * factor;
    if (std::abs(table_.number(next_, value_) - expected) > 1e-9 * std::abs(expected)) {
      table_.refuse(next_, value_,
                    formatNumber(expected) + ", the model's figure times the multiplier");
    }
    ++next_;
    return factor;
  }

 private:
  void requireNumber(std::size_t column, int expected) const {
    if (table_.wholeNumber(next_, column) == expected) return;
    table_.refuse(next_, column, std::to_string(expected) + " here");
  }

  const CsvTable& table_;
  std::size_t task_, field_, row_, col_, multiplier_, value_;
  std::size_t next_ = 0;
};

}  // namespace

std::vector<Walker2dTask> readWalker2dTasks(const std::string& path, const MujocoModel& base) {
  const CsvTable table = CsvTable::load(path);
  const std::vector<Field> fields = fieldsOf(base.get());
  std::size_t figures = 0;
  for (const Field& field : fields) figures += static_cast<std::size_t>(field.rows * field.columns);
  if (table.numRows() == 0 || table.numRows() % figures != 0) {
    throw Error(path + " has " + std::to_string(table.numRows()) + " rows but must have " +
                std::to_string(figures) + " for each task.");
  }
  TaskReader reader(table);
  std::vector<Walker2dTask> tasks;
  while (!reader.atEnd()) {
    Walker2dTask task;
    for (const Field& field : fields) {
      for (int row = 0; row < field.rows; ++row) {
        for (int col = 0; col < field.columns; ++col) {
          const double factor = reader.read(static_cast<int>(tasks.size()), field, row, col);
          (task.*field.factors).push_back(factor);
        }
      }
    }
    tasks.push_back(std::move(task));
  }
  return tasks;
}

}  // namespace pmeta
