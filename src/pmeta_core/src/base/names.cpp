#include "pmeta_core/base/names.h"

#include <algorithm>

#include "pmeta_core/base/error.h"
#include "pmeta_core/base/format.h"

namespace pmeta {
namespace {

constexpr std::size_t kLongestName = 200;

std::size_t editDistance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t substitute = diagonal + (a[i - 1] != b[j - 1]);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, substitute});
    }
  }
  return row.back();
}

}  // namespace

std::string nearest(const std::string& word, const std::vector<std::string>& candidates) {
  std::string best;
  std::size_t best_distance = std::max<std::size_t>(2, word.size() / 4) + 1;
  for (const std::string& candidate : candidates) {
    const std::size_t distance = editDistance(word, candidate);
    if (distance < best_distance) {
      best_distance = distance;
      best = candidate;
    }
  }
  return best;
}

std::vector<std::string> nearestFirst(const std::string& word,
                                      std::vector<std::string> candidates) {
  std::stable_sort(candidates.begin(), candidates.end(),
                   [&](const std::string& a, const std::string& b) {
                     return editDistance(word, a) < editDistance(word, b);
                   });
  return candidates;
}

std::string didYouMean(const std::string& word, const std::vector<std::string>& known) {
  const std::string guess = nearest(word, known);
  return guess.empty() ? "." : ": did you mean '" + guess + "'?";
}

std::string unknownName(const std::string& kind, const std::string& name,
                        const std::vector<std::string>& known) {
  return "unknown " + kind + " " + shown(name) + didYouMean(name, known) + " Known are " +
         join(known) + ".";
}

void requirePlainName(const std::string& key, const std::string& value) {
  if (value.empty() || value.find_first_of("/ \\\"'") != std::string::npos || value == "." ||
      value == ".." || !isPlainText(value)) {
    throw Error(key + " is " + shown(value) +
                " but must be a plain name in UTF-8, without blanks, quotes or slashes.");
  }
  if (value.size() > kLongestName) {
    throw Error(key + " is " + shown(value) + ", a name of " + std::to_string(value.size()) +
                " bytes, but must have at most " + std::to_string(kLongestName) + ".");
  }
}

std::string join(const std::vector<std::string>& words, const std::string& separator) {
  std::string text;
  for (std::size_t i = 0; i < words.size(); ++i) text += (i == 0 ? "" : separator) + words[i];
  return text;
}

}  // namespace pmeta
