#pragma once

#include <cstdint>
#include <iosfwd>
#include <string>
#include <vector>

#include "render_core/scene/formats/byte_source.h"
#include "render_core/scene/formats/file_set.h"
#include "render_core/scene/formats/load_context.h"
#include "render_core/scene/gaussian_cloud.h"

namespace catgs {

// glTF 2.0 with KHR_gaussian_splatting, as text (.gltf) or binary (.glb). Scales and opacities are
// stored as plain values. glTF's axes are left, up, front; GaussianCloud's are right, down, front,
// half a turn about z away.
//
// Sorting: the extension's default is the distance from the camera, we blend by depth. Colours of
// lin_rec709_display are linear light, while we blend sRGB values as trained. They are encoded
// Gaussian by Gaussian: the harmonics become those nearest to the encoded colours of all
// directions. Opaque surfaces then look as they should, and blended edges a little darker.

struct GltfSize {
  std::uint64_t count = 0;
  int sh_degree = 0;
};
/// From the JSON alone. `beside`: the folder of the file. Throws InputError as read_gltf() does.
GltfSize read_gltf_size(const ByteSource& file, const FileSet& beside);

struct GltfFile {
  GaussianCloud cloud;             // not sanitized
  std::vector<std::string> notes;  // for people: what is not shown as its author meant it
};
/// All Gaussians of the file's scene, moved, turned and stretched as its nodes say. Throws
/// InputError naming the field. Errors include a node that two nodes hold, and extensions that the
/// file requires and that are not known.
GltfFile read_gltf(const ByteSource& file, const FileSet& beside, const LoadContext& context);

/// Writes a .glb with floats: what read_gltf() reads from it is the same, bit for bit. Throws
/// InputError when the file would exceed the 4 GiB of the format.
void write_glb(const GaussianCloud& cloud, std::ostream& to);

}  // namespace catgs
