#pragma once

#include <cstddef>
#include <cstdint>

namespace pmeta::fuzz {

// Each target feeds one parser with arbitrary bytes. Error is the right answer to most of them;
// whatever else a target throws, and whatever a sanitizer reports, is a finding.

void fuzzCheckpoint(const std::uint8_t* data, std::size_t size);
void fuzzCsv(const std::uint8_t* data, std::size_t size);
void fuzzLayout(const std::uint8_t* data, std::size_t size);
void fuzzMessage(const std::uint8_t* data, std::size_t size);
void fuzzPolicy(const std::uint8_t* data, std::size_t size);
void fuzzReplay(const std::uint8_t* data, std::size_t size);
void fuzzSettings(const std::uint8_t* data, std::size_t size);

}  // namespace pmeta::fuzz
