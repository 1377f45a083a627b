#pragma once

#include <cstdint>
#include <filesystem>

#include "render_core/walk/walk_map.h"

namespace catgs {

/// Prints what a map holds. `bytes`: of its file.
void print_map(const walk::WalkMap& map, std::uint64_t bytes);

/// Writes the plan of each storey: `out`, or with several storeys plan-0.png, plan-1.png… from
/// below, for a name of plan.png. Throws InputError.
void write_plans(const walk::WalkMap& map, const std::filesystem::path& out);

}  // namespace catgs
