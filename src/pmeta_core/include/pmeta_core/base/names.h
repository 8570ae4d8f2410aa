#pragma once

#include <string>
#include <vector>

namespace pmeta {

/// The candidate closest to `word` by edit distance, or "" if none is close.
std::string nearest(const std::string& word, const std::vector<std::string>& candidates);

/// All of them, the closest to `word` first.
std::vector<std::string> nearestFirst(const std::string& word, std::vector<std::string> candidates);

/// The end of a sentence about a word that is none of `known`: ": did you mean 'gridworld'?", or
/// "." where none is close.
std::string didYouMean(const std::string& word, const std::vector<std::string>& known);

/// What to say of a name that is none of `known`: "unknown environment 'gridwold': did you mean
/// 'gridworld'? Known are cart_pole, gridworld." `kind` is what it should name.
std::string unknownName(const std::string& kind, const std::string& name,
                        const std::vector<std::string>& known);

/// Throws Error unless `value` can name a file or folder: not empty, no blanks, quotes or slashes.
void requirePlainName(const std::string& key, const std::string& value);

/// "a, b, c": words joined for messages and tables.
std::string join(const std::vector<std::string>& words, const std::string& separator = ", ");

}  // namespace pmeta
