#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace catgs {

/// The one of `names` that `unknown` was probably meant to be. At most a third of its letters may
/// have to be inserted, deleted, changed or swapped with their neighbour. A name that continues
/// `unknown` after a dash counts as nearer: "--token" means --token-file, not --open. Empty where
/// no name is near enough.
std::string nearest_name(std::string_view unknown, const std::vector<std::string>& names);

/// The remedy for an unknown name: "did you mean NEAREST?", or `otherwise` where none is near.
std::string suggest_name(std::string_view unknown, const std::vector<std::string>& names,
                         std::string_view otherwise);

}  // namespace catgs
