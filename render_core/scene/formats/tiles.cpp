#include "render_core/scene/formats/tiles.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <nlohmann/json.hpp>

#include "render_core/base/error.h"
#include "render_core/scene/copy_gaussians.h"
#include "render_core/scene/formats/axes.h"
#include "render_core/scene/formats/format_limits.h"
#include "render_core/scene/formats/gltf.h"
#include "render_core/scene/formats/gltf_document.h"
#include "render_core/scene/formats/implicit_tiles.h"
#include "render_core/scene/formats/json_field.h"
#include "render_core/scene/formats/scene_format.h"
#include "render_core/scene/transform.h"

namespace catgs {

namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t max_tileset_bytes = 32 << 20;
constexpr std::size_t max_tiles = std::size_t{1} << 16;
constexpr int max_tile_depth = 64;  // in one file
constexpr int max_tilesets_in_depth = 16;
constexpr std::size_t max_uri_bytes = 4096;

// WGS84, metres.
constexpr double equator_radius = 6'378'137.0, pole_radius = 6'356'752.314245;

struct Content {
  std::string name;
  AffineMap map;  // from the tile to the tileset
  GltfSize size;
};

/// The values that a tile inherits from its parent.
struct Above {
  std::optional<std::size_t> node{};
  AffineMap map{};
  bool adds = false;
};

/// A tileset that a tile holds, to be read.
struct External {
  std::string name;
  Above above;
  int tilesets = 0;  // that hold one another
};

struct Tileset {
  DetailTree tree;
  std::vector<std::vector<Content>> contents;  // by node
  glm::dvec3 middle{0.0};                      // of the root's bounding volume
};

bool refine_adds(const JsonField& word) {
  if (word.text() == "ADD" || word.text() == "add") return true;
  if (word.text() != "REPLACE" && word.text() != "replace") word.fail("is neither ADD nor REPLACE");
  return false;
}

/// Longitude, latitude in radians and height in metres to Earth-centred coordinates.
glm::dvec3 on_globe(double longitude, double latitude, double height) {
  const double e2 = 1.0 - pole_radius * pole_radius / (equator_radius * equator_radius);
  const double sine = std::sin(latitude);
  const double n = equator_radius / std::sqrt(1.0 - e2 * sine * sine);
  return {(n + height) * std::cos(latitude) * std::cos(longitude),
          (n + height) * std::cos(latitude) * std::sin(longitude),
          (n * (1.0 - e2) + height) * sine};
}

/// The middle of a tile's bounding volume, in the tileset.
glm::dvec3 middle_of(const JsonField& volume, const AffineMap& map) {
  if (const auto region = volume.find("region")) {  // is not moved with its tile
    const auto [west, south, east, north, low, high] = region->doubles<6>();
    return on_globe((west + east) / 2.0, (south + north) / 2.0, (low + high) / 2.0);
  }
  if (const auto box = volume.find("box")) {
    const auto numbers = box->doubles<12>();
    return map({numbers[0], numbers[1], numbers[2]});
  }
  if (const auto sphere = volume.find("sphere")) {
    const auto numbers = sphere->doubles<4>();
    return map({numbers[0], numbers[1], numbers[2]});
  }
  return map.offset;
}

/// Reads tilesets into one tree.
class TilesetReader {
 public:
  explicit TilesetReader(const FileSet& files) : files_(files) {}

  Tileset read(const std::string& index) {
    std::vector<External> waiting = {{index, {}, 1}};
    while (!waiting.empty()) {
      const External next = std::move(waiting.back());
      waiting.pop_back();
      read_file(next, waiting);
    }
    return std::move(tileset_);
  }

 private:
  void read_file(const External& wanted, std::vector<External>& waiting);
  void read_tile(const JsonField& tile, const Above& above, int depth,
                 std::vector<External>& found);
  void read_content(const JsonField& content, std::size_t node, const AffineMap& map,
                    std::vector<External>& found);
  /// `field`: for error messages.
  void read_content_at(const std::string& uri, const JsonField& field, std::size_t node,
                       const AffineMap& map, std::vector<External>& found);
  void read_implicit(const JsonField& tile, std::size_t node, const AffineMap& map,
                     std::vector<External>& found);
  Content read_gltf_content(const std::string& name, const AffineMap& map) const;

  const FileSet& files_;
  fs::path folder_;  // of the file that is read
  Tileset tileset_;
};

void TilesetReader::read_file(const External& wanted, std::vector<External>& waiting) {
  const auto file = files_.open(wanted.name);
  if (wanted.tilesets > max_tilesets_in_depth)
    throw InputError(file->name(), "",
                     fmt::format("is the last of more than {} tilesets that hold one another",
                                 max_tilesets_in_depth));
  const nlohmann::json document = read_json(*file, max_tileset_bytes);
  const JsonField meta(file->name(), document);
  const JsonField version = meta.at("asset").at("version");
  if (version.text() != "1.0" && version.text() != "1.1")
    version.fail("is not supported", "3D Tiles 1.0 and 1.1 are");
  if (const auto axis = meta.at("asset").find("gltfUpAxis"); axis && axis->text() != "Y")
    axis->fail("is not supported", "make the tiles again: contents of 3D Tiles have y up");
  if (const auto required = meta.find("extensionsRequired"))
    for (std::size_t i = 0; i < required->size(); ++i)
      if ((*required)[i].text() != "3DTILES_content_gltf")
        (*required)[i].fail(fmt::format("'{}' is not supported", (*required)[i].text()),
                            "make the tiles without this extension");
  folder_ = fs::path(wanted.name).parent_path();
  std::vector<External> found;
  read_tile(meta.at("root"), wanted.above, 0, found);
  for (External& external : found) external.tilesets = wanted.tilesets + 1;
  waiting.insert(waiting.end(), found.rbegin(), found.rend());
}

/// Recursive; max_tile_depth bounds it.
void TilesetReader::read_tile(const JsonField& tile, const Above& above, int depth,
                              std::vector<External>& found) {
  if (depth > max_tile_depth) tile.fail(fmt::format("lies deeper than {}", max_tile_depth));
  if (tileset_.tree.nodes.size() == max_tiles)
    tile.fail(fmt::format("is one of more than {}", max_tiles));
  AffineMap map = above.map;
  if (const auto transform = tile.find("transform")) map = map * affine_map(*transform);
  if (!map.usable()) tile.fail("has a transform without an inverse");
  const auto word = tile.find("refine");
  const bool adds = word ? refine_adds(*word) : above.adds;
  if (tileset_.tree.nodes.empty())
    if (const auto volume = tile.find("boundingVolume")) tileset_.middle = middle_of(*volume, map);
  const std::size_t node = tileset_.tree.add(above.node, adds);
  tileset_.contents.emplace_back();
  if (tile.find("implicitTiling")) return read_implicit(tile, node, map, found);
  if (const auto content = tile.find("content")) read_content(*content, node, map, found);
  if (const auto contents = tile.find("contents"))
    for (std::size_t i = 0; i < contents->size(); ++i)
      read_content((*contents)[i], node, map, found);
  if (const auto children = tile.find("children"))
    for (std::size_t i = 0; i < children->size(); ++i)
      read_tile((*children)[i], {node, map, adds}, depth + 1, found);
}

void TilesetReader::read_content(const JsonField& content, std::size_t node, const AffineMap& map,
                                 std::vector<External>& found) {
  const auto named = content.find("uri");
  const JsonField uri = named ? *named : content.at("url");  // before version 1.0
  read_content_at(uri.text(), uri, node, map, found);
}

void TilesetReader::read_content_at(const std::string& uri, const JsonField& field,
                                    std::size_t node, const AffineMap& map,
                                    std::vector<External>& found) {
  if (uri.size() > max_uri_bytes) field.fail(fmt::format("has more than {} bytes", max_uri_bytes));
  const std::string path = uri.substr(0, uri.find_first_of("?#"));
  if (path.find(':') < path.find('/'))  // a scheme
    field.fail("names no file of the scene's folder");
  const std::string name = FilesBelow::name_of(folder_, unescaped(path));
  if (name.ends_with(".json")) {
    found.push_back({name, {node, map, tileset_.tree.nodes[node].adds}});
    return;
  }
  Content read = read_gltf_content(name, map);
  tileset_.tree.add_gaussians(node, read.size.count);
  tileset_.contents[node].push_back(std::move(read));
}

/// All tiles move as the tile that stands for them.
void TilesetReader::read_implicit(const JsonField& tile, std::size_t node, const AffineMap& map,
                                  std::vector<External>& found) {
  const bool adds = tileset_.tree.nodes[node].adds;
  const std::vector<ImplicitTile> tiles = read_implicit_tiles(
      tile, FilesBelow(files_, folder_), max_tiles - tileset_.tree.nodes.size() + 1);
  std::vector<std::size_t> nodes;
  for (const ImplicitTile& one : tiles) {
    nodes.push_back(one.above ? tileset_.tree.add(nodes[*one.above], adds) : node);
    if (one.above) tileset_.contents.emplace_back();
    for (const std::string& uri : one.contents)
      read_content_at(uri, tile, nodes.back(), map, found);
  }
}

Content TilesetReader::read_gltf_content(const std::string& name, const AffineMap& map) const {
  const auto file = files_.open(name);
  for (const std::string_view other : {"b3dm", "i3dm", "pnts", "cmpt", "vctr", "geom", "subt"})
    if (begins_with(*file, other))
      throw InputError(file->name(), "", fmt::format("is a tile of the format {}", other),
                       "Gaussians are in glTF tiles");
  return {name, map, read_gltf_size(*file, FilesBelow(files_, fs::path(name).parent_path()))};
}

/// From a tileset to GaussianCloud's world. Adds a note where the origin moves.
AffineMap world_from_tileset(const glm::dvec3& middle, std::vector<std::string>& notes) {
  constexpr double far = 10'000.0, near_globe = 50'000.0;
  AffineMap map{quarter_turn_about_x, glm::dvec3(0.0)};
  const double distance = glm::length(middle);
  if (distance <= far) return map;
  const glm::dvec3 radii(equator_radius, equator_radius, pole_radius);
  const bool globe = std::abs(glm::length(middle / radii) - 1.0) * equator_radius < near_globe;
  if (globe) {
    const glm::dvec3 up = glm::normalize(middle / (radii * radii));
    const glm::dvec3 towards_east(-middle.y, middle.x, 0.0);
    const glm::dvec3 east =
        glm::length(towards_east) > 1.0 ? glm::normalize(towards_east) : glm::dvec3(0.0, 1.0, 0.0);
    map.linear = quarter_turn_about_x * glm::transpose(glm::dmat3(east, glm::cross(up, east), up));
  }
  map.offset = -(map.linear * middle);
  notes.push_back(fmt::format("its origin is [{:.3f}, {:.3f}, {:.3f}] of the tileset{}", middle.x,
                              middle.y, middle.z,
                              globe ? ", on the globe, with east, north and up as axes" : ""));
  return map;
}

/// The contents to load.
struct Chosen {
  std::shared_ptr<const FileSet> folder;
  std::vector<Content> contents;
  AffineMap world;
  int sh_degree = 0;
};

GaussianCloud read_part(const Chosen& chosen, std::size_t part, const glm::dvec3& origin,
                        const LoadContext& context) {
  const Content& content = chosen.contents[part];
  const auto file = chosen.folder->open(content.name);
  const FilesBelow beside(*chosen.folder, fs::path(content.name).parent_path());
  AffineMap map = chosen.world * content.map * AffineMap{quarter_turn_about_x, glm::dvec3(0.0)};
  map.offset -= origin;
  GltfFile gltf = read_gltf(*file, beside, context, map);
  if (gltf.cloud.size() != content.size.count || gltf.cloud.sh_degree != content.size.sh_degree)
    throw InputError(file->name(), "", "was changed while the scene was read");
  return with_sh_degree(std::move(gltf.cloud), chosen.sh_degree);
}

}  // namespace

OpenLevels open_tiles(const std::shared_ptr<const FileSet>& folder, const std::string& index,
                      std::optional<int> level, std::optional<std::size_t> budget,
                      std::uint64_t most) {
  const auto file = folder->open(index);
  Tileset tileset = TilesetReader(UnsharedFiles(*folder, file->name())).read(index);
  const DetailChoice choice = choose_detail(tileset.tree, file->name(), level, budget);
  if (choice.count == 0) throw InputError(file->name(), "root", "holds no Gaussians");

  OpenLevels scene;
  scene.format = fmt::format("3D Tiles ({})", choice.text);
  scene.levels = tileset.tree.levels();
  scene.count = choice.count;
  auto chosen = std::make_shared<Chosen>();
  chosen->folder = folder;
  chosen->world = world_from_tileset(tileset.middle, scene.notes);
  std::uint64_t bytes = 0;
  for (const std::size_t node : choice.nodes)
    for (Content& content : tileset.contents[node]) {
      bytes += content.size.bytes;
      scene.sh_degree = std::max(scene.sh_degree, content.size.sh_degree);
      for (const std::string& note : content.size.notes) add_note(scene.notes, note);
      chosen->contents.push_back(std::move(content));
    }
  require_plausible_count(*file, "root", scene.count, GaussianCloud::bytes(1, scene.sh_degree),
                          bytes, most);
  chosen->sh_degree = scene.sh_degree;
  scene.parts = chosen->contents.size();
  scene.read = [chosen](std::size_t part, const glm::dvec3& origin, const LoadContext& context) {
    return read_part(*chosen, part, origin, context);
  };
  return scene;
}

constexpr SceneFormat tiles_format = {
    .name = "3D Tiles",
    .index = "tileset.json",
    .json_is_data = true,
    .open_levels = open_tiles,
};

}  // namespace catgs
