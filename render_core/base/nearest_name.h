#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace catgs {

/// The one of `names` that was probably meant by `unknown`: at most a third of its letters would
/// have to be put in, taken away, changed or swapped with their neighbour. One that only goes on
/// behind a dash is nearer than others: "--token" means --token-file, not --open. Empty where none
/// is so near.
std::string nearest_name(std::string_view unknown, const std::vector<std::string>& names);

/// The remedy for an unknown name: "did you mean NEAREST?", or `otherwise` where none is near.
std::string suggest_name(std::string_view unknown, const std::vector<std::string>& names,
                         std::string_view otherwise);

}  // namespace catgs
