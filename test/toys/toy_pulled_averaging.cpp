// An algorithm in a file of its own: personal policies are pulled, and are themselves averaged.
#include "pmeta_core/experiment/algorithm.h"

namespace {

using namespace pmeta;

Algorithm pulledAveraging() {
  Algorithm row;
  row.label = "pulled averaging";
  row.meaning = "personal policies are pulled, and are themselves aggregated";
  row.sent = Sent::kPersonal;
  row.pulls = true;
  return row;
}

const Registered<Algorithm> kRow(algorithms(), "toy_pulled_averaging", pulledAveraging());

}  // namespace
