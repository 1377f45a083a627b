#pragma once

#include <cstdint>
#include <iosfwd>
#include <string>
#include <vector>

#include "render_core/scene/formats/byte_source.h"
#include "render_core/scene/formats/file_set.h"
#include "render_core/scene/formats/json_field.h"
#include "render_core/scene/formats/load_context.h"
#include "render_core/scene/gaussian_cloud.h"
#include "render_core/scene/transform.h"

namespace catgs {

struct SceneFormat;

// glTF 2.0 with KHR_gaussian_splatting, as text (.gltf) or binary (.glb). Scales and opacities are
// stored as plain values. glTF's axes are left, up, front; GaussianCloud's are right, down, front,
// half a turn about z away.
//
// Sorting: the extension's default is the distance from the camera, we blend by depth. Colours of
// lin_rec709_display are linear light, while we blend sRGB values as trained. They are encoded
// Gaussian by Gaussian: the harmonics become those nearest to the encoded colours of all
// directions. Opaque surfaces then look as they should, and blended edges a little darker.
//
// A primitive may hold an .spz (KHR_gaussian_splatting_compression_spz_2, a draft that Cesium's
// tiles use, and three earlier names of it). Its numbers are those of glTF as they are stored, as
// CesiumJS reads them, whatever axes the .spz names.

struct GltfSize {
  std::uint64_t count = 0;
  int sh_degree = 0;
  std::uint64_t bytes = 0;         // of the buffers
  std::vector<std::string> notes;  // as GltfFile::notes
};
/// From the JSON alone, and from the headers of each .spz. `beside`: the folder of the file. Throws
/// InputError as read_gltf() does.
GltfSize read_gltf_size(const ByteSource& file, const FileSet& beside);

struct GltfFile {
  GaussianCloud cloud;             // not sanitized
  std::vector<std::string> notes;  // for people: what is not shown as its author meant it
};
/// From glTF's axes to those of GaussianCloud.
inline const AffineMap left_up_front{{-1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0}, {}};
/// All Gaussians of the file's scene, moved, turned and stretched as its nodes and then `world`
/// say. Throws InputError naming the field. Errors include a node that two nodes hold, and
/// extensions that the file requires and that are not known.
GltfFile read_gltf(const ByteSource& file, const FileSet& beside, const LoadContext& context,
                   const AffineMap& world = left_up_front);

/// The names of the files beside it that a .gltf has its data in. Throws InputError.
std::vector<std::string> gltf_buffer_files(const ByteSource& file);

/// The map of a 4x4 matrix by columns. Throws InputError when its last row is not 0, 0, 0, 1 but
/// for rounding.
AffineMap affine_map(const JsonField& matrix);

/// Writes a .glb with floats: what read_gltf() reads from it is the same, bit for bit. Throws
/// InputError when the file would exceed the 4 GiB of the format.
void write_glb(const GaussianCloud& cloud, std::ostream& to);

extern const SceneFormat gltf_format;

}  // namespace catgs
