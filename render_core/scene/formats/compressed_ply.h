#pragma once

#include "render_core/scene/formats/byte_source.h"
#include "render_core/scene/formats/load_context.h"
#include "render_core/scene/formats/ply_header.h"
#include "render_core/scene/gaussian_cloud.h"

namespace catgs {

/// Whether the header is that of PlayCanvas' compressed .ply: 16 bytes per Gaussian, quantised
/// between the limits of its chunk of 256.
bool is_compressed_ply(const PlyHeader& header);

/// Element `chunk` holds min_* and max_* of position, log scale and (in newer files) colour;
/// `vertex` packed_position and packed_scale (11-10-11 bits), packed_rotation (2-10-10-10,
/// smallest three), packed_color (8-8-8-8 with opacity); the optional `sh` f_rest_* bytes for
/// [-4, 4]. Not sanitized, about `origin`. Throws InputError.
GaussianCloud read_compressed_ply(const ByteSource& file, const PlyHeader& header,
                                  const LoadContext& context,
                                  const glm::dvec3& origin = glm::dvec3(0.0));

}  // namespace catgs
