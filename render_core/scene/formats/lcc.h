#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "render_core/scene/formats/byte_source.h"
#include "render_core/scene/formats/detail_tree.h"
#include "render_core/scene/formats/file_set.h"
#include "render_core/scene/formats/format_limits.h"

namespace catgs {

struct SceneFormat;

// LCC of XGRIDS, the format before LCC2: an .lcc (JSON), index.bin with the cells of a grid and
// their levels of detail, data.bin with 32 bytes a Gaussian, shcoef.bin with harmonics if the
// scene has some, and environment.bin, if there is one, that every level shows. z points up.

/// Checks all claims before memory is taken. Arguments and errors as open_lcc2().
OpenLevels open_lcc(const std::shared_ptr<const FileSet>& folder, const std::string& index,
                    std::optional<int> level, std::optional<std::size_t> budget,
                    std::uint64_t most = max_gaussians);

extern const SceneFormat lcc_format;

}  // namespace catgs
