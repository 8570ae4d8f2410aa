#include "pmeta_core/verify/model_check.h"

#include <gtest/gtest.h>

#include <functional>

#include "../support.h"
#include "recorded_file.h"

namespace pmeta {
namespace {

using test::Altered;
using test::errorOf;
using test::Lines;

std::string pathOf(const std::string& kind) {
  return std::string(PMETA_TEST_DATA) + "/" + kind + ".csv.gz";
}

ModelReport altered(const std::string& kind, const std::function<void(Lines&)>& change) {
  const Altered file(pathOf(kind), change);
  return checkModel(kind, file.path());
}

// the line of a figure in the file, as an index into Lines
std::size_t indexOf(const Lines& lines, const std::string& array, const std::string& row,
                    const std::string& col) {
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (lines[i][0] == array && lines[i][1] == row && lines[i][2] == col) return i;
  }
  ADD_FAILURE() << "no " << array;
  return 0;
}

TEST(ModelCheck, TheShippedModelsAreTheOriginals) {
  for (const auto& [kind, figures] :
       {std::pair{"half_cheetah_model", 1286}, std::pair{"ant_model", 1842},
        std::pair{"walker2d_model", 1255}}) {
    const ModelReport report = checkModel(kind, pathOf(kind));
    EXPECT_TRUE(report.ok()) << modelTable(report);
    EXPECT_EQ(report.figures, figures);
    EXPECT_EQ(report.arrays.size(), 118u);
    for (const ModelArrayErrors& array : report.arrays) {
      EXPECT_LE(array.largest, 1e-12) << array.array;
    }
  }
}

TEST(ModelCheck, OneAlteredFigureIsNamed) {
  std::size_t index = 0;
  const ModelReport report = altered("walker2d_model", [&](Lines& lines) {
    index = indexOf(lines, "geom_friction", "7", "0");
    EXPECT_EQ(lines[index][4].substr(0, 3), "1.8");  // 1.9, the left foot's
    lines[index][4] = "0.9";
  });
  ASSERT_FALSE(report.ok());
  EXPECT_EQ(report.deviations, 1);
  EXPECT_EQ(report.first->line, static_cast<long>(index) + 1);
  const std::string table = modelTable(report);
  EXPECT_NE(table.find("NOT ok: 1 figures lie beyond their tolerance, first line " +
                       std::to_string(index + 1) +
                       ", geom_friction row 7 col 0 (foot_left_geom): recorded 0.9, compiled 1.9"),
            std::string::npos)
      << table;
}

TEST(ModelCheck, TolerancesAreRelativeWithAFloor) {
  const auto scaled = [](const char* array, double factor, double add) {
    return altered("half_cheetah_model",
                   [&](Lines& lines) {
                     std::string& cell = lines[indexOf(lines, array, "1", "0")][4];
                     cell = formatNumber(std::stod(cell) * factor + add);
                   })
        .ok();
  };
  EXPECT_TRUE(scaled("body_mass", 1 + 0.9e-9, 0));
  EXPECT_FALSE(scaled("body_mass", 1 + 1.2e-9, 0));
  EXPECT_TRUE(scaled("body_pos", 1, 0.9e-12));  // the torso's x, 0
  EXPECT_FALSE(scaled("body_pos", 1, 1.2e-12));
}

TEST(ModelCheck, QuaternionsCountUpToSign) {
  const auto negated = [](std::initializer_list<int> cols) {
    return altered("half_cheetah_model",
                   [&](Lines& lines) {
                     for (const int col : cols) {
                       std::string& cell =
                           lines[indexOf(lines, "geom_quat", "3", std::to_string(col))][4];
                       cell = formatNumber(-std::stod(cell));
                     }
                   })
        .ok();
  };
  EXPECT_TRUE(negated({0, 1, 2, 3}));
  EXPECT_FALSE(negated({0}));
  EXPECT_FALSE(negated({2}));
}

TEST(ModelCheck, OtherFilesAreRefused) {
  const auto refused = [](const std::function<void(Lines&)>& change) {
    const Altered file(pathOf("ant_model"), change);
    const std::string error = errorOf([&] { checkModel("ant_model", file.path()); });
    return error.compare(0, file.path().size(), file.path()) == 0 ? error.substr(file.path().size())
                                                                  : error;
  };
  EXPECT_EQ(refused([](Lines& l) { l[1][0] = "size.legs"; }),
            " line 2 column array is 'size.legs' but must be a field of mjModel.");
  EXPECT_EQ(refused([](Lines& l) { l[1][1] = "1"; }),
            " line 2 column row is '1' but must be a whole number, from 0 to 0.");
  EXPECT_EQ(refused([](Lines& l) { l[0][4] = "figure"; }),
            " line 1 names no column 'value': is this the right kind of file?");
  EXPECT_EQ(refused([](Lines& l) { l.resize(1); }), " holds no figures, only a header.");
  EXPECT_EQ(errorOf([] { checkModel("dog_model", pathOf("ant_model")); }),
            "unknown model 'dog_model'. Known are ant_model, half_cheetah_model, walker2d_model.");
  // another model's figures
  EXPECT_NE(errorOf([] { checkModel("half_cheetah_model", pathOf("ant_model")); }), "(no error)");
  EXPECT_FALSE(checkModel("ant_model", pathOf("walker2d_model")).ok());
}

}  // namespace
}  // namespace pmeta
