#include "pmeta_core/verify/model_check.h"

#include <mujoco/mjxmacro.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <map>

#include "pmeta_core/base/csv_table.h"
#include "pmeta_core/base/error.h"
#include "pmeta_core/base/names.h"
#include "pmeta_core/base/number.h"
#include "pmeta_core/env/ant.h"
#include "pmeta_core/env/half_cheetah.h"
#include "pmeta_core/env/walker2d.h"

namespace pmeta {
namespace {

constexpr double kTolerance = 1e-9;
constexpr double kSmallest = 1e-3;  ///< smaller figures have the tolerance of this one

/// An array of a compiled model, or a single figure.
struct ModelArray {
  int rows;
  int columns;
  std::function<double(int)> at;  ///< by row * columns + column
};

template <class T>
ModelArray arrayOf(const T* values, int rows, int columns) {
  return {rows, columns, [values](int i) { return static_cast<double>(values[i]); }};
}

// all that mjModel holds, by MuJoCo's own list of its fields
std::map<std::string, ModelArray> arraysOf(const mjModel* m) {
  std::map<std::string, ModelArray> arrays;
  // one function, or the hundreds of lines below take long to compile
  const auto enter = [&arrays](const char* name, const auto* values, int rows, int columns) {
    arrays[name] = arrayOf(values, rows, columns);
  };
#define X(name) enter("size." #name, &m->name, 1, 1);
  MJMODEL_INTS
#undef X
#define X(type, name) enter("opt." #name, &m->opt.name, 1, 1);
  MJOPTION_SCALARS
#undef X
#define X(name, n) enter("opt." #name, m->opt.name, 1, n);
  MJOPTION_VECTORS
#undef X
  enter("stat.meaninertia", &m->stat.meaninertia, 1, 1);
  enter("stat.meanmass", &m->stat.meanmass, 1, 1);
  enter("stat.meansize", &m->stat.meansize, 1, 1);
  enter("stat.extent", &m->stat.extent, 1, 1);
  enter("stat.center", m->stat.center, 1, 3);
  MJMODEL_POINTERS_PREAMBLE(m)
#define X(type, name, nr, nc) enter(#name, m->name, m->nr, nc);
  MJMODEL_POINTERS
#undef X
  return arrays;
}

const std::map<std::string, const MujocoLayout& (*)()>& kinds() {
  static const std::map<std::string, const MujocoLayout& (*)()> kKinds = {
      {"ant_model", Ant::layout},
      {"half_cheetah_model", HalfCheetah::layout},
      {"walker2d_model", Walker2d::layout},
  };
  return kKinds;
}

// one line of the file
struct Figure {
  ModelDeviation as_recorded;
  const ModelArray* array = nullptr;
};

class FigureReader {
 public:
  FigureReader(const CsvTable& table, const std::map<std::string, ModelArray>& arrays)
      : table_(table),
        arrays_(arrays),
        array_(table.column("array")),
        row_(table.column("row")),
        col_(table.column("col")),
        name_(table.column("name")),
        value_(table.column("value")) {}

  Figure read(std::size_t row) const {
    Figure figure;
    ModelDeviation& d = figure.as_recorded;
    d.line = table_.line(row);
    d.array = table_.text(row, array_);
    const auto found = arrays_.find(d.array);
    if (found == arrays_.end()) table_.refuse(row, array_, "a field of mjModel");
    figure.array = &found->second;
    d.row = table_.wholeNumber(row, row_, Range::between(0, figure.array->rows - 1));
    d.col = table_.wholeNumber(row, col_, Range::between(0, figure.array->columns - 1));
    d.name = table_.text(row, name_);
    d.recorded = table_.number(row, value_);
    d.compiled = figure.array->at(d.row * figure.array->columns + d.col);
    return figure;
  }

 private:
  const CsvTable& table_;
  const std::map<std::string, ModelArray>& arrays_;
  std::size_t array_, row_, col_, name_, value_;
};

bool isQuaternion(const std::string& array) {
  return array.size() > 4 && array.compare(array.size() - 4, 4, "quat") == 0;
}

// a quaternion and its negative are the same rotation: take the one that is nearer
void alignQuaternions(std::vector<Figure>& figures) {
  std::map<std::pair<std::string, int>, double> products;
  for (const Figure& f : figures) {
    const ModelDeviation& d = f.as_recorded;
    if (isQuaternion(d.array)) products[{d.array, d.row}] += d.recorded * d.compiled;
  }
  for (Figure& f : figures) {
    ModelDeviation& d = f.as_recorded;
    if (isQuaternion(d.array) && products[{d.array, d.row}] < 0) d.compiled = -d.compiled;
  }
}

void enter(const ModelDeviation& figure, ModelReport& report) {
  auto entry = std::find_if(report.arrays.begin(), report.arrays.end(),
                            [&](const ModelArrayErrors& one) { return one.array == figure.array; });
  if (entry == report.arrays.end()) {
    entry = report.arrays.insert(entry, ModelArrayErrors{figure.array});
  }
  ++entry->figures;
  ++report.figures;
  const double error =
      std::abs(figure.compiled - figure.recorded) / std::max(std::abs(figure.recorded), kSmallest);
  if (error > entry->largest) {
    entry->largest = error;
    entry->line = figure.line;
  }
  if (error <= kTolerance) return;
  if (report.deviations++ == 0) report.first = figure;
}

}  // namespace

std::vector<std::string> modelKinds() {
  std::vector<std::string> names;
  for (const auto& kind : kinds()) names.push_back(kind.first);
  return names;
}

bool isModelKind(const std::string& kind) { return kinds().count(kind) > 0; }

ModelReport checkModel(const std::string& kind, const std::string& path) {
  const auto found = kinds().find(kind);
  if (found == kinds().end()) {
    throw Error(unknownName("model", kind, modelKinds()));
  }
  const auto model = MujocoModel::open("", found->second());
  const auto arrays = arraysOf(model->get());
  const CsvTable table = CsvTable::load(path);
  const FigureReader reader(table, arrays);
  if (table.numRows() == 0) throw Error(path + " holds no figures, only a header.");
  std::vector<Figure> figures;
  for (std::size_t row = 0; row < table.numRows(); ++row) figures.push_back(reader.read(row));
  alignQuaternions(figures);

  ModelReport report;
  report.kind = kind;
  report.path = path;
  for (const Figure& figure : figures) enter(figure.as_recorded, report);
  return report;
}

std::string modelTable(const ModelReport& report) {
  std::string text = report.path + ": " + std::to_string(report.figures) + " figures in " +
                     std::to_string(report.arrays.size()) + " arrays\nlargest relative error\n";
  std::size_t exact = 0;
  const NumbersWithDots dots;
  char line[160];
  for (const ModelArrayErrors& one : report.arrays) {
    if (one.largest == 0) {
      ++exact;
      continue;
    }
    std::snprintf(line, sizeof line, "  %-24s%.2g (line %ld)\n", one.array.c_str(), one.largest,
                  one.line);
    text += line;
  }
  text += "  " + std::to_string(exact) + " arrays        0\n";
  if (report.ok()) return text + "ok: every figure lies within its tolerance\n";
  const ModelDeviation& d = *report.first;
  return text + "NOT ok: " + std::to_string(report.deviations) +
         " figures lie beyond their tolerance, first line " + std::to_string(d.line) + ", " +
         d.array + " row " + std::to_string(d.row) + " col " + std::to_string(d.col) +
         (d.name.empty() ? "" : " (" + d.name + ")") + ": recorded " + formatNumber(d.recorded) +
         ", compiled " + formatNumber(d.compiled) + ", tolerance 1e-09 relative\n";
}

}  // namespace pmeta
