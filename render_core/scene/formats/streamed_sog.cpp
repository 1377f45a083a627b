#include "render_core/scene/formats/streamed_sog.h"

#include <algorithm>
#include <charconv>
#include <limits>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "render_core/base/error.h"
#include "render_core/scene/formats/format_limits.h"
#include "render_core/scene/formats/json_field.h"
#include "render_core/scene/formats/scene_format.h"

namespace catgs {

namespace {

constexpr const char* index_name = "lod-meta.json";
constexpr std::uint64_t max_tree_bytes = 32 << 20;  // 6 M Gaussians take 242 KB
constexpr std::uint64_t max_levels = 16;
constexpr std::size_t max_files = std::size_t{1} << 16;
constexpr std::size_t max_name_bytes = 4096;
constexpr std::size_t max_nodes = std::size_t{1} << 16;
constexpr int max_tree_depth = 64;

LodPiece parse_piece(const JsonField& field, std::size_t file_count) {
  const LodPiece piece{field.at("file").count(), field.at("offset").count(),
                       field.at("count").count()};
  if (piece.file >= file_count)
    field.at("file").fail(fmt::format("is {}, and there are {}", piece.file, file_count));
  if (piece.offset > max_gaussians || piece.count > max_gaussians) field.fail("is out of range");
  return piece;
}

std::vector<std::optional<LodPiece>> parse_node(const JsonField& lods, const LodTree& tree) {
  std::vector<std::optional<LodPiece>> pieces(static_cast<std::size_t>(tree.levels));
  if (!lods.value().is_object()) lods.fail("is not an object");
  for (const auto& [key, value] : lods.value().items()) {
    std::size_t level = 0;
    const auto [end, error] = std::from_chars(key.data(), key.data() + key.size(), level);
    if (error != std::errc{} || end != key.data() + key.size() || level >= pieces.size())
      lods.fail(fmt::format("'{}' is not a level in 0…{}", key, tree.levels - 1));
    pieces[level] = parse_piece(lods.at(key), tree.files.size());
  }
  return pieces;
}

/// Recursive; max_tree_depth bounds it.
void parse_tree(const JsonField& node, int depth, LodTree& tree) {
  if (depth > max_tree_depth) node.fail(fmt::format("lies deeper than {}", max_tree_depth));
  if (const auto lods = node.find("lods")) {
    if (tree.nodes.size() == max_nodes) lods->fail(fmt::format("is node {}", max_nodes + 1));
    tree.nodes.push_back(parse_node(*lods, tree));
  }
  if (const auto children = node.find("children"))
    for (std::size_t i = 0; i < children->size(); ++i) parse_tree((*children)[i], depth + 1, tree);
}

/// The level that the node offers for `wanted`; -1 when the node is empty.
int level_for(const std::vector<std::optional<LodPiece>>& node, int wanted) {
  const int levels = static_cast<int>(node.size());
  for (int level = wanted; level < levels; ++level)
    if (node[static_cast<std::size_t>(level)]) return level;
  for (int level = wanted - 1; level >= 0; --level)
    if (node[static_cast<std::size_t>(level)]) return level;
  return -1;
}

LodChoice choose(const LodTree& tree, const std::vector<int>& wanted) {
  LodChoice choice;
  choice.finest = std::numeric_limits<int>::max();
  for (std::size_t n = 0; n < tree.nodes.size(); ++n) {
    const int level = level_for(tree.nodes[n], wanted[n]);
    if (level < 0) continue;
    choice.pieces.push_back(*tree.nodes[n][static_cast<std::size_t>(level)]);
    choice.count += choice.pieces.back().count;
    choice.finest = std::min(choice.finest, level);
    choice.coarsest = std::max(choice.coarsest, level);
  }
  return choice;
}

StreamedSogPart open_part(const FileSet& folder, const std::string& name) {
  if (name.ends_with(".sog"))
    return {name, read_sog_meta(ZipFiles(*folder.open(name)), "meta.json"), {}};
  return {"", read_sog_meta(folder, name), {}};
}

void decode_part(const FileSet& folder, const StreamedSogPart& part, const glm::dvec3& origin,
                 GaussianCloud& cloud, const LoadContext& context) {
  if (part.archive.empty())
    return decode_sog(folder, part.meta, part.ranges, cloud, context, origin);
  decode_sog(ZipFiles(*folder.open(part.archive)), part.meta, part.ranges, cloud, context, origin);
}

/// Files of the chosen pieces, with ranges that fill the cloud from 0 on.
std::vector<StreamedSogPart> open_parts(const FileSet& folder, const LodTree& tree,
                                        std::vector<LodPiece> pieces, std::size_t& total) {
  std::stable_sort(pieces.begin(), pieces.end(), [](const LodPiece& a, const LodPiece& b) {
    return std::pair(a.file, a.offset) < std::pair(b.file, b.offset);
  });
  std::vector<StreamedSogPart> parts;
  std::optional<std::size_t> open_file;
  std::size_t end_of_last = 0;
  for (const LodPiece& piece : pieces) {
    if (piece.count == 0) continue;
    if (open_file != piece.file) {
      parts.push_back(open_part(folder, tree.files[piece.file]));
      open_file = piece.file;
      end_of_last = 0;
    }
    StreamedSogPart& part = parts.back();
    if (piece.offset < end_of_last || piece.offset + piece.count > part.meta.count)
      throw InputError(
          tree.name, "tree",
          fmt::format("Gaussians {} to {} of {} overlap others or are not there", piece.offset,
                      piece.offset + piece.count, tree.files[piece.file]));
    part.ranges.push_back({piece.offset, piece.count, total});
    end_of_last = piece.offset + piece.count;
    total += piece.count;
  }
  return parts;
}

LodChoice choose(const LodTree& tree, std::optional<int> level, std::optional<std::size_t> budget,
                 std::size_t environment_count) {
  require_level(tree.name, tree.levels, level, budget);
  if (!budget) return choose_level(tree, level.value_or(0));
  const std::size_t room = *budget > environment_count ? *budget - environment_count : 0;
  if (auto choice = choose_within_budget(tree, room)) return *std::move(choice);
  fail_budget(tree.name, *budget, choose_level(tree, tree.levels - 1).count + environment_count);
}

/// Gaussians that a part has in the scene.
std::size_t size_of(const StreamedSogPart& part) {
  const SogRange& last = part.ranges.back();
  return last.destination + last.count - part.ranges.front().destination;
}

}  // namespace

LodTree read_lod_tree(const ByteSource& file) {
  const nlohmann::json document = read_json(file, max_tree_bytes);
  const JsonField meta(file.name(), document);
  LodTree tree;
  tree.name = file.name();
  if (const auto version = meta.find("version"); version && version->count() != 1)
    version->fail("is not supported", "version 1 is");
  const std::uint64_t levels = meta.at("lodLevels").count();
  if (levels < 1 || levels > max_levels)
    meta.at("lodLevels").fail(fmt::format("is not in 1…{}", max_levels));
  tree.levels = static_cast<int>(levels);
  const JsonField names = meta.at("filenames");
  if (names.size() > max_files) names.fail(fmt::format("has more than {} entries", max_files));
  const auto file_named_by = [&](const JsonField& field) {
    std::string name = field.text();
    if (name.size() > max_name_bytes)
      field.fail(fmt::format("has more than {} bytes", max_name_bytes));
    return name;
  };
  for (std::size_t i = 0; i < names.size(); ++i) tree.files.push_back(file_named_by(names[i]));
  if (const auto environment = meta.find("environment"))
    tree.environment = file_named_by(*environment);
  parse_tree(meta.at("tree"), 0, tree);
  return tree;
}

LodChoice choose_level(const LodTree& tree, int level) {
  return choose(tree, std::vector<int>(tree.nodes.size(), level));
}

std::optional<LodChoice> choose_within_budget(const LodTree& tree, std::size_t budget) {
  int level = tree.levels - 1;
  LodChoice choice = choose_level(tree, level);
  if (choice.count > budget) return std::nullopt;
  for (; level > 0; --level) {
    LodChoice finer = choose_level(tree, level - 1);
    if (finer.count > budget) break;
    choice = std::move(finer);
  }
  if (level == 0) return choice;

  std::vector<std::pair<std::size_t, std::size_t>> costs;  // additional Gaussians, node
  const auto count_at = [&](std::size_t n, int wanted) {
    const int found = level_for(tree.nodes[n], wanted);
    return found < 0 ? 0 : tree.nodes[n][static_cast<std::size_t>(found)]->count;
  };
  for (std::size_t n = 0; n < tree.nodes.size(); ++n) {
    const std::size_t now = count_at(n, level), then = count_at(n, level - 1);
    costs.emplace_back(then > now ? then - now : 0, n);
  }
  std::sort(costs.begin(), costs.end());
  std::vector<int> wanted(tree.nodes.size(), level);
  std::size_t room = budget - choice.count;
  for (const auto& [cost, n] : costs) {
    if (cost > room) break;
    room -= cost;
    wanted[n] = level - 1;
  }
  return choose(tree, wanted);
}

std::size_t count_streamed_sog(const FileSet& folder, std::optional<int> level,
                               std::optional<std::size_t> budget) {
  const LodTree tree = read_lod_tree(*folder.open(index_name));
  const std::size_t environment =
      tree.environment.empty() ? 0 : open_part(folder, tree.environment).meta.count;
  return choose(tree, level, budget, environment).count + environment;
}

OpenStreamedSog open_streamed_sog(const FileSet& folder, std::optional<int> level,
                                  std::optional<std::size_t> budget, std::uint64_t most) {
  const LodTree tree = read_lod_tree(*folder.open(index_name));
  const UnsharedFiles files(folder, tree.name);
  std::vector<StreamedSogPart> environment;
  if (!tree.environment.empty()) environment.push_back(open_part(files, tree.environment));
  const std::size_t environment_count = environment.empty() ? 0 : environment[0].meta.count;
  const LodChoice choice = choose(tree, level, budget, environment_count);

  if (choice.pieces.empty()) throw InputError(tree.name, "tree", "has no levels of detail");

  OpenStreamedSog scene;
  scene.levels = tree.levels;
  scene.parts = open_parts(files, tree, choice.pieces, scene.count);
  for (StreamedSogPart& part : environment) {
    part.ranges.push_back({0, part.meta.count, scene.count});
    scene.count += part.meta.count;
    scene.parts.push_back(std::move(part));
  }
  require_plausible_count(*folder.open(index_name), "tree", scene.count, sog_least_bytes,
                          files.bytes(), most);
  for (const StreamedSogPart& part : scene.parts)
    scene.sh_degree = std::max(scene.sh_degree, part.meta.sh_degree);
  scene.detail = choice.finest == choice.coarsest
                     ? fmt::format("level {} of 0…{}", choice.finest, tree.levels - 1)
                     : fmt::format("levels {} and {} of 0…{}", choice.finest, choice.coarsest,
                                   tree.levels - 1);
  return scene;
}

GaussianCloud read_streamed_sog_part(const FileSet& folder, const OpenStreamedSog& scene,
                                     std::size_t part, const glm::dvec3& origin,
                                     const LoadContext& context) {
  StreamedSogPart alone = scene.parts[part];
  const std::size_t first = alone.ranges.front().destination;
  for (SogRange& range : alone.ranges) range.destination -= first;
  GaussianCloud cloud;
  cloud.resize(size_of(alone), scene.sh_degree);
  decode_part(folder, alone, origin, cloud, context);
  return cloud;
}

GaussianCloud read_streamed_sog(const FileSet& folder, const OpenStreamedSog& scene,
                                const LoadContext& context, const glm::dvec3& origin) {
  GaussianCloud cloud;
  cloud.resize(scene.count, scene.sh_degree);
  const auto total = static_cast<double>(scene.count);
  std::size_t done = 0;
  for (const StreamedSogPart& part : scene.parts) {
    const double from = static_cast<double>(done) / total;
    for (const SogRange& range : part.ranges) done += range.count;
    decode_part(folder, part, origin, cloud, context.part(from, static_cast<double>(done) / total));
  }
  cloud.model = std::ranges::max_element(scene.parts, {}, size_of)->meta.model;
  return cloud;
}

namespace {

OpenLevels open_levels(const std::shared_ptr<const FileSet>& files, const std::string& /*index*/,
                       std::optional<int> level, std::optional<std::size_t> budget,
                       std::uint64_t most) {
  const auto sog =
      std::make_shared<const OpenStreamedSog>(open_streamed_sog(*files, level, budget, most));
  OpenLevels scene;
  scene.format = fmt::format("streamed sog ({})", sog->detail);
  scene.levels = sog->levels;
  scene.sh_degree = sog->sh_degree;
  scene.count = sog->count;
  scene.parts = sog->parts.size();
  for (const StreamedSogPart& part : sog->parts)
    for (const std::string& note : part.meta.notes) add_note(scene.notes, note);
  scene.read = [files, sog](std::size_t part, const glm::dvec3& origin,
                            const LoadContext& context) {
    return read_streamed_sog_part(*files, *sog, part, origin, context);
  };
  scene.read_all = [files, sog](const glm::dvec3& origin, const LoadContext& context) {
    return read_streamed_sog(*files, *sog, context, origin);
  };
  return scene;
}

/// An archive is unpacked as a whole only where its environment counts, too.
std::size_t count_chosen(const SceneFiles& files, std::optional<int> level,
                         std::optional<std::size_t> budget) {
  if (files.index.empty()) {
    const auto tree = files.open(index_name);
    if (read_lod_tree(*tree->open(index_name)).environment.empty())
      return count_streamed_sog(*tree, level, budget);
  }
  return count_streamed_sog(*files.open(), level, budget);
}

}  // namespace

constexpr SceneFormat streamed_sog_format = {
    .name = "streamed SOG",
    .extensions = {".ssog"},
    .index = index_name,
    .is_mine = [](const ByteSource&, std::string_view extension) { return extension == ".ssog"; },
    .open_levels = open_levels,
    .count = count_chosen,
};

}  // namespace catgs
