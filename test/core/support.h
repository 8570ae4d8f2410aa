#pragma once

#include <stdlib.h>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "pmeta_core/base/error.h"
#include "pmeta_core/experiment/experiment.h"

namespace pmeta::test {

/// The sentence of the Error that `call` throws, or "(no error)".
template <class Call>
std::string errorOf(Call&& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "(no error)";
}

/// A folder of its own for one test, gone afterwards.
class TempDir {
 public:
  TempDir() {
    std::string name = (std::filesystem::temp_directory_path() / "pmeta_test_XXXXXX").string();
    path_ = mkdtemp(name.data());
  }
  ~TempDir() { std::filesystem::remove_all(path_); }
  TempDir(const TempDir&) = delete;
  TempDir& operator=(const TempDir&) = delete;

  const std::string& path() const { return path_; }
  std::string operator/(const std::string& name) const { return path_ + "/" + name; }

 private:
  std::string path_;
};

/// Sets an environment variable (or unsets it, given nullptr) until the end of the scope.
class ScopedVariable {
 public:
  ScopedVariable(const char* name, const char* value) : name_(name) {
    const char* old = getenv(name);
    had_ = old != nullptr;
    if (had_) old_ = old;
    value == nullptr ? unsetenv(name) : setenv(name, value, 1);
  }
  ~ScopedVariable() { had_ ? setenv(name_, old_.c_str(), 1) : unsetenv(name_); }
  ScopedVariable(const ScopedVariable&) = delete;
  ScopedVariable& operator=(const ScopedVariable&) = delete;

 private:
  const char* name_;
  bool had_ = false;
  std::string old_;
};

inline std::string readFile(const std::string& path) {
  std::ostringstream text;
  std::ifstream file(path);
  text << file.rdbuf();
  return text.str();
}

inline void writeFile(const std::string& path, const std::string& text) {
  std::ofstream(path) << text;
}

/// The paper's gridworld experiment with a fixed run id, writing below /tmp unless told otherwise.
inline Experiment gridExperiment(const std::vector<std::string>& overrides = {}) {
  return Experiment::parse(R"(
experiment: grid
run_id: run
results_dir: /tmp/pmeta_unused
rounds: 10
updates_per_round: 3
personal: {alpha: 0.08, lambda: 10, eta: 0.08, personal_init: meta}
q_learning: {gamma: 0.9, updates: 1, samples_per_entry: 2}
aggregation: {beta: 1}
environment: {name: gridworld, sizes: [4, 5, 6, 7, 8], landmark: corner}
)",
                           "grid.yaml", overrides);
}

/// Pearson's statistic of counts against equal expectations.
inline double chiSquare(const std::vector<int>& counts) {
  double total = 0;
  for (const int count : counts) total += count;
  const double expected = total / static_cast<double>(counts.size());
  double sum = 0;
  for (const int count : counts) sum += (count - expected) * (count - expected) / expected;
  return sum;
}

}  // namespace pmeta::test
