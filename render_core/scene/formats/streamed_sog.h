#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "render_core/scene/formats/file_set.h"
#include "render_core/scene/formats/format_limits.h"
#include "render_core/scene/formats/load_context.h"
#include "render_core/scene/formats/sog.h"
#include "render_core/scene/gaussian_cloud.h"

namespace catgs {

struct SceneFormat;

// PlayCanvas' streamed SOG: a folder of SOGs and lod-meta.json, a tree whose nodes hold the same
// part of the scene at several levels of detail. We load one level per node, once.

/// The position of a node's level: Gaussians [offset, offset + count) of a file.
struct LodPiece {
  std::size_t file = 0;
  std::size_t offset = 0;
  std::size_t count = 0;
};

struct LodTree {
  std::string name;  // of the lod-meta.json, for error messages
  int levels = 0;
  std::vector<std::string> files;  // names of meta.json or .sog files
  std::string environment;         // drawn with every level; may be empty
  /// For each node its pieces by level, 0 the finest; a node may lack levels.
  std::vector<std::vector<std::optional<LodPiece>>> nodes;
};

/// Reads lod-meta.json. Throws InputError naming the field.
LodTree read_lod_tree(const ByteSource& file);

/// The pieces to load, one for every node that has any.
struct LodChoice {
  std::vector<LodPiece> pieces;
  int finest = 0, coarsest = 0;  // levels among the pieces
  std::size_t count = 0;         // Gaussians, the environment not among them
};

/// Level `level` everywhere. Nodes that lack it use their next coarser level, else the next finer
/// one.
LodChoice choose_level(const LodTree& tree, int level);

/// The finest level whose Gaussians fit into `budget`. As many nodes as still fit then get the next
/// finer level, cheapest first. Empty when not even the coarsest level fits.
std::optional<LodChoice> choose_within_budget(const LodTree& tree, std::size_t budget);

/// Number of Gaussians that `level` or `budget` select (see open_streamed_sog), the environment
/// included. Reads lod-meta.json and the environment's meta data only. Throws InputError.
std::size_t count_streamed_sog(const FileSet& folder, std::optional<int> level,
                               std::optional<std::size_t> budget);

/// One of the SOGs that a level consists of. Nothing of its files stays in memory, because a scene
/// may have thousands.
struct StreamedSogPart {
  std::string archive;  // its name; empty: its files lie in the folder
  SogMeta meta;
  std::vector<SogRange> ranges;  // consecutive in the whole scene
};

/// A streamed SOG whose meta data was read and checked.
struct OpenStreamedSog {
  int levels = 0;
  std::string detail;  // the chosen levels, for people: "level 2 of 0…6"
  int sh_degree = 0;
  std::size_t count = 0;  // Gaussians, at least 1
  std::vector<StreamedSogPart> parts;
};

/// Opens the streamed SOG in `folder`; without `level` and `budget` the finest level. The
/// environment counts towards the budget. Throws InputError. Errors include: both are given, there
/// is no such level, the coarsest level exceeds the budget, SOGs share a file, there are more than
/// `most` Gaussians.
OpenStreamedSog open_streamed_sog(const FileSet& folder, std::optional<int> level,
                                  std::optional<std::size_t> budget,
                                  std::uint64_t most = max_gaussians);

/// The Gaussians of a part with the SH degree of the whole, not sanitized, about `origin`. Throws
/// InputError.
GaussianCloud read_streamed_sog_part(const FileSet& folder, const OpenStreamedSog& scene,
                                     std::size_t part, const glm::dvec3& origin,
                                     const LoadContext& context);

/// All parts, not sanitized, about `origin`. Throws InputError.
GaussianCloud read_streamed_sog(const FileSet& folder, const OpenStreamedSog& scene,
                                const LoadContext& context,
                                const glm::dvec3& origin = glm::dvec3(0.0));

extern const SceneFormat streamed_sog_format;

}  // namespace catgs
