#pragma once

#include "render_core/scene/formats/byte_source.h"
#include "render_core/scene/formats/load_context.h"
#include "render_core/scene/formats/scene_format.h"
#include "render_core/scene/gaussian_cloud.h"

namespace catgs {

// The .ksplat format of mkkellogg/GaussianSplats3D, version 0.1: sections of rows, of which each
// has its own SH degree in 0…2. Compression level 0 stores floats. Levels 1 and 2 store half
// floats, and means as 16 bits around the centre of a bucket; level 2 stores harmonics as bytes.
// Colour and opacity are bytes at every level. The format has no mark at its start and is
// recognised by its name.

/// From the headers alone. Throws InputError as read_ksplat() does.
SceneSize read_ksplat_size(const ByteSource& file);

/// Not sanitized, about `origin`. Throws InputError naming the field.
GaussianCloud read_ksplat(const ByteSource& file, const LoadContext& context,
                          const glm::dvec3& origin = glm::dvec3(0.0));

extern const SceneFormat ksplat_format;

}  // namespace catgs
