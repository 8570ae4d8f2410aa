#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace pmeta::test {

/// A file of test/data with what an independent float64 implementation gives.
inline nlohmann::json loadOracle(const std::string& name) {
  std::ifstream file(PMETA_TEST_DATA "/" + name);
  return nlohmann::json::parse(file);
}

/// All numbers of a (nested) list, one after the other.
inline std::vector<double> flat(const nlohmann::json& list) {
  if (list.is_number()) return {list.get<double>()};
  std::vector<double> all;
  for (const auto& entry : list) {
    const std::vector<double> more = flat(entry);
    all.insert(all.end(), more.begin(), more.end());
  }
  return all;
}

/// ||a - b|| / ||b||.
template <class Numbers>
double relativeError(const Numbers& a, const std::vector<double>& b) {
  EXPECT_EQ(a.size(), b.size());
  double difference = 0, norm = 0;
  for (std::size_t k = 0; k < b.size(); ++k) {
    difference += (a[k] - b[k]) * (a[k] - b[k]);
    norm += b[k] * b[k];
  }
  return std::sqrt(difference / norm);
}

}  // namespace pmeta::test
