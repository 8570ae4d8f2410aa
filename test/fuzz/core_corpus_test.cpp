#include "corpus_replay.h"

namespace pmeta::fuzz {
namespace {

TEST(FuzzCorpus, Checkpoint) { replayCorpus("checkpoint", fuzzCheckpoint); }
TEST(FuzzCorpus, Csv) { replayCorpus("csv", fuzzCsv); }
TEST(FuzzCorpus, Layout) { replayCorpus("layout", fuzzLayout); }
TEST(FuzzCorpus, Policy) { replayCorpus("policy", fuzzPolicy); }
TEST(FuzzCorpus, Replay) { replayCorpus("replay", fuzzReplay); }
TEST(FuzzCorpus, Settings) { replayCorpus("settings", fuzzSettings); }

}  // namespace
}  // namespace pmeta::fuzz
