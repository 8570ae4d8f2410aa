#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "pmeta_core/base/settings.h"

namespace pmeta::test {

/// One setting of each kind.
struct SampleSettings {
  std::string title = "demo";
  int rounds = 10;
  std::int64_t seed = 0;
  bool verbose = true;
  double lambda = 10;
  std::string init = "meta";
  double personal_rate = 0.1;
  double q_rate = 0.2;
  double gamma = 0.9;
  int offset = 0;
  std::vector<int> sizes = {4, 5};
  std::vector<double> slip = {0};
  std::vector<std::string> labels = {"a"};
  std::vector<std::string> corners = {"left"};
  std::vector<int> any = {0};
  Settings settings;

  SampleSettings() {
    settings.bind("title", title, "name of it");
    settings.bind("rounds", rounds, "C", Range::between(1, 1e6));
    settings.bind("seed", seed, "seed", Range::atLeast(0));
    settings.bind("verbose", verbose, "talk");
    settings.bind("personal.lambda", lambda, "pull", Range::atLeast(0));
    settings.bind("personal.init", init, "start", {"meta", "keep"});
    settings.bind("personal.rate", personal_rate, "step", Range::above(0));
    settings.bind("q_learning.rate", q_rate, "step");
    settings.bind("q_learning.gamma", gamma, "discount", Range::halfOpen(0, 1));
    settings.bind("q_learning.offset", offset, "any whole number");
    settings.bind("environment.sizes", sizes, "cells", Range::between(2, 512));
    settings.bind("environment.slip", slip, "chance", Range::halfOpen(0, 1));
    settings.bind("environment.labels", labels, "texts");
    settings.bind("environment.corners", corners, "words", {"left", "right"});
    settings.bind("environment.any", any, "whole numbers");
  }

  void read(const std::string& yaml) { settings.read(parseYaml(yaml, "a.yaml"), "a.yaml"); }
};

}  // namespace pmeta::test
