#include <cstdio>
#include <iostream>
#include "pmeta_core/base/error.h"
#include "pmeta_core/run/local_runner.h"
using namespace pmeta;
int main(int argc, char** argv) {
  try {
    std::vector<std::string> o(argv + 2, argv + argc);
    auto e = Experiment::load(argv[1], o);
    for (auto& n : e.notes()) std::cerr << n << "\n";
    runLocally(e, nullptr, [](const RoundSummary& s) {
      std::printf("%d %.3f %.3f\n", s.round, s.personal_return, s.meta_return);
      return true;
    });
  } catch (const Error& x) {
    std::cerr << x.what() << "\n";
    return 1;
  }
}
