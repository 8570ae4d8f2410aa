#include "corpus_replay.h"

namespace pmeta::fuzz {
namespace {

TEST(FuzzCorpus, Message) { replayCorpus("message", fuzzMessage); }

}  // namespace
}  // namespace pmeta::fuzz
