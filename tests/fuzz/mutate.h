#pragma once

#include <cstddef>
#include <random>
#include <span>
#include <string>

namespace catgs::fuzz {

/// One of `inputs` with a few changes: bits, numbers, words of the format, ranges that are erased,
/// doubled or taken from another input. Not longer than `max_bytes`. The same for the same
/// `random`.
std::string mutant(std::mt19937_64& random, std::span<const std::string> inputs,
                   std::span<const std::string> words, std::size_t max_bytes);

}  // namespace catgs::fuzz
