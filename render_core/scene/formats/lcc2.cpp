#include "render_core/scene/formats/lcc2.h"

#include <algorithm>
#include <map>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <glm/matrix.hpp>
#include <nlohmann/json.hpp>

#include "render_core/base/error.h"
#include "render_core/scene/copy_gaussians.h"
#include "render_core/scene/formats/axes.h"
#include "render_core/scene/formats/json_field.h"
#include "render_core/scene/formats/model_statements.h"
#include "render_core/scene/formats/scene_format.h"
#include "render_core/scene/formats/sog.h"
#include "render_core/scene/formats/spz.h"
#include "render_core/scene/keep_if.h"
#include "render_core/scene/transform.h"

namespace catgs {

namespace {

constexpr std::uint64_t max_lcc2_bytes = 32 << 20;
constexpr std::size_t max_files = std::size_t{1} << 16;
constexpr std::size_t max_name_bytes = 4096;
constexpr std::size_t max_key_bytes =
    256;  // of a child: error messages repeat it for each node below
constexpr std::size_t max_nodes = std::size_t{1} << 16;
constexpr int max_node_depth = 64;

/// Its licence asks for these words.
constexpr std::string_view licence_words = "LCC2: Data Organization Format originated from XGRIDS";

/// Gaussians [begin, begin + count) of a file.
struct Piece {
  std::size_t file = 0, begin = 0, count = 0;
};

struct Index {
  std::string name;  // of the .lcc2, for error messages
  bool is_spz = false;
  std::vector<std::string> files;
  std::optional<std::size_t> environment;  // its file
  DetailTree tree;
  std::vector<Piece> pieces;  // by node
  ModelStatements statements;
};

std::size_t file_at(const JsonField& index, const Index& scene) {
  if (index.count() >= scene.files.size())
    index.fail(fmt::format("is {}, and there are {}", index.count(), scene.files.size()));
  return index.count();
}

Piece parse_piece(const JsonField& field, const Index& scene) {
  Piece piece;
  piece.count = field.at("count").count();
  if (piece.count == 0) return piece;
  piece.file = file_at(field.at("name"), scene);
  if (const auto start = field.find("start")) piece.begin = start->count();
  if (piece.begin > max_gaussians || piece.count > max_gaussians) field.fail("is out of range");
  return piece;
}

/// Recursive; max_node_depth bounds it.
void parse_node(const JsonField& node, std::optional<std::size_t> above, int depth, Index& scene) {
  if (depth > max_node_depth) node.fail(fmt::format("lies deeper than {}", max_node_depth));
  if (scene.tree.nodes.size() == max_nodes)
    node.fail(fmt::format("is one of more than {}", max_nodes));
  const std::size_t index = scene.tree.add(above, false);
  const auto data = node.find("data");
  const auto gaussians = data ? data->find("3dgs") : std::nullopt;
  scene.pieces.push_back(gaussians ? parse_piece(*gaussians, scene) : Piece{});
  scene.tree.add_gaussians(index, scene.pieces.back().count);
  const auto children = node.find("child");
  if (!children) return;
  if (children->value().is_object())
    for (const auto& [key, value] : children->value().items()) {
      if (key.size() > max_key_bytes)
        children->fail(fmt::format("has a key of more than {} bytes", max_key_bytes));
      parse_node(children->at(key), index, depth + 1, scene);
    }
  else
    for (std::size_t i = 0; i < children->size(); ++i)
      parse_node((*children)[i], index, depth + 1, scene);
}

/// Earlier versions call the list "files", begin its names with a slash and leave the extension
/// out.
void parse_files(const JsonField& meta, const JsonField& root, Index& scene) {
  const auto of_root = root.find("splatFiles");
  const auto named = of_root ? of_root : meta.find("splatFiles");
  const JsonField names = named ? *named : root.at("files");
  if (names.size() > max_files) names.fail(fmt::format("has more than {} entries", max_files));
  const std::string_view extension = scene.is_spz ? ".spz" : ".sog";
  for (std::size_t i = 0; i < names.size(); ++i) {
    std::string name = names[i].text();
    if (name.size() > max_name_bytes)
      names[i].fail(fmt::format("has more than {} bytes", max_name_bytes));
    if (!named && name.starts_with('/')) name.erase(0, 1);
    if (!named && !name.ends_with(extension)) name += extension;
    scene.files.push_back(std::move(name));
  }
}

Index parse_scene(const ByteSource& file) {
  const nlohmann::json document = read_json(file, max_lcc2_bytes);
  const JsonField meta(file.name(), document);
  Index scene;
  scene.name = file.name();
  scene.statements.read_members(document);
  if (const auto version = meta.find("version"); version && !version->text().starts_with("0.0."))
    version->fail("is not supported", "0.0.3 is");
  if (const auto type = meta.find("splatType")) {
    scene.is_spz = type->text() == ".spz";
    if (!scene.is_spz && type->text() != ".sog")
      type->fail("is not supported", ".sog and .spz are");
  }
  const JsonField root = meta.at("root");
  parse_files(meta, root, scene);
  const auto data = root.find("data");
  if (const auto environment = data ? data->find("env") : std::nullopt)
    scene.environment = file_at(environment->at("name"), scene);
  parse_node(root, {}, 0, scene);
  return scene;
}

/// A file with the Gaussians that are taken of it.
struct Part {
  std::string name;
  bool is_spz = false;
  std::uint64_t held = 0;  // Gaussians in the file
  int file_degree = 0;
  std::vector<SogRange> ranges;  // in order, and in the part one after the other
  std::size_t count = 0;
  std::vector<std::string> notes{};

  void take(std::size_t begin, std::size_t taken) {
    ranges.push_back({begin, taken, count});
    count += taken;
  }
};

/// Reads no more of the file than tells its size.
Part open_part(const FileSet& files, const Index& scene, std::size_t file) {
  constexpr const char* meta_name = "meta.json";
  Part part;
  part.name = scene.files[file];
  part.is_spz = scene.is_spz;
  const auto source = files.open(part.name);
  if (scene.is_spz) {
    const SceneSize size = read_spz_size(*source);
    part.held = size.gaussians;
    part.file_degree = size.sh_degree;
  } else {
    SogMeta meta = parse_sog_meta(ZipFiles(*source, meta_name), meta_name);
    if (meta.hides_sh_degree()) meta = read_sog_meta(ZipFiles(*source), meta_name);
    part.held = meta.count;
    part.file_degree = meta.sh_degree;
    part.notes = std::move(meta.notes);
  }
  return part;
}

/// The files of the chosen nodes, with their ranges.
std::vector<Part> open_parts(const FileSet& files, const Index& scene, const DetailChoice& choice) {
  std::map<std::size_t, std::vector<Piece>> by_file;
  for (const std::size_t node : choice.nodes)
    by_file[scene.pieces[node].file].push_back(scene.pieces[node]);
  std::vector<Part> parts;
  for (auto& [file, pieces] : by_file) {
    Part part = open_part(files, scene, file);
    std::ranges::sort(pieces, {}, &Piece::begin);
    std::size_t end_of_last = 0;
    for (const Piece& piece : pieces) {
      if (piece.begin < end_of_last || piece.begin + piece.count > part.held)
        throw InputError(scene.name, "root",
                         fmt::format("Gaussians {} to {} of {} overlap others or are not there",
                                     piece.begin, piece.begin + piece.count, part.name));
      part.take(piece.begin, piece.count);
      end_of_last = piece.begin + piece.count;
    }
    parts.push_back(std::move(part));
  }
  return parts;
}

void require_unchanged(const ByteSource& file, bool same) {
  if (!same) throw InputError(file.name(), "", "was changed while the scene was read");
}

GaussianCloud read_spz_ranges(const ByteSource& file, const Part& part,
                              const LoadContext& context) {
  GaussianCloud cloud = read_spz(file, context, SpzAxes::as_stored).cloud;
  require_unchanged(file, cloud.size() == part.held);
  auto range = part.ranges.begin();
  keep_if(cloud, [&](std::size_t i) {
    while (range != part.ranges.end() && i >= range->begin + range->count) ++range;
    return range != part.ranges.end() && i >= range->begin;
  });
  return cloud;
}

GaussianCloud read_sog_ranges(const ByteSource& file, const Part& part, int sh_degree,
                              const glm::dvec3& origin, const LoadContext& context) {
  const ZipFiles files(file);
  const SogMeta meta = read_sog_meta(files, "meta.json");
  require_unchanged(file, meta.count == part.held && meta.sh_degree == part.file_degree);
  GaussianCloud cloud;
  cloud.resize(part.count, sh_degree);
  decode_sog(files, meta, part.ranges, cloud, context, origin);
  return cloud;
}

GaussianCloud read_part(const FileSet& folder, const Part& part, int sh_degree,
                        const glm::dvec3& origin, const LoadContext& context) {
  const auto file = folder.open(part.name);
  const LoadContext reading = context.part(0.0, 0.8);
  // An .spz has at most 24 bits a coordinate, which a float holds.
  const glm::dvec3 stored_origin = glm::transpose(quarter_turn_about_x) * origin;
  GaussianCloud cloud;
  if (part.is_spz) {
    cloud = with_sh_degree(read_spz_ranges(*file, part, reading), sh_degree);
    move_origin(cloud, stored_origin);
  } else {
    cloud = read_sog_ranges(*file, part, sh_degree, stored_origin, reading);
  }
  const CloudTransform transform({quarter_turn_about_x, {}});
  context.part(0.8, 1.0).for_blocks(cloud.size(), 1024, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) transform.apply(cloud, i);
  });
  return cloud;
}

}  // namespace

std::vector<std::string> lcc2_files(const ByteSource& file) { return parse_scene(file).files; }

OpenLevels open_lcc2(const std::shared_ptr<const FileSet>& folder, const std::string& index,
                     std::optional<int> level, std::optional<std::size_t> budget,
                     std::uint64_t most) {
  const auto file = folder->open(index);
  const Index lcc2 = parse_scene(*file);
  const UnsharedFiles files(*folder, lcc2.name);
  std::vector<Part> environment;
  if (lcc2.environment) {
    environment.push_back(open_part(files, lcc2, *lcc2.environment));
    environment[0].take(0, environment[0].held);
  }
  const std::size_t always = environment.empty() ? 0 : environment[0].count;
  const DetailChoice choice = choose_detail(lcc2.tree, lcc2.name, level, budget, always);
  const auto parts = std::make_shared<std::vector<Part>>(open_parts(files, lcc2, choice));
  if (parts->empty()) throw InputError(lcc2.name, "root", "holds no Gaussians");
  parts->insert(parts->end(), environment.begin(), environment.end());

  OpenLevels scene;
  scene.format = fmt::format("LCC2 ({})", choice.text);
  scene.levels = lcc2.tree.levels();
  scene.count = choice.count + always;
  scene.notes.emplace_back(licence_words);
  int file_degree = 0;
  for (const Part& part : *parts) file_degree = std::max(file_degree, part.file_degree);
  for (const std::string& note : notes_of_degree(file_degree)) add_note(scene.notes, note);
  for (const std::string& note : lcc2.statements.notes) add_note(scene.notes, note);
  for (const Part& part : *parts)
    for (const std::string& note : part.notes) add_note(scene.notes, note);
  scene.sh_degree = std::min(file_degree, max_sh_degree);
  require_plausible_count(*file, "root", scene.count, sog_least_bytes, files.bytes(), most);
  scene.parts = parts->size();
  scene.read = [folder, parts, degree = scene.sh_degree, model = lcc2.statements.model](
                   std::size_t part, const glm::dvec3& origin, const LoadContext& context) {
    GaussianCloud cloud = read_part(*folder, (*parts)[part], degree, origin, context);
    cloud.model = model.value_or(cloud.model);
    return cloud;
  };
  return scene;
}

constexpr SceneFormat lcc2_format = {
    .name = "LCC2",
    .extensions = {".lcc2"},
    .names_folder = true,
    .is_mine = [](const ByteSource&, std::string_view extension) { return extension == ".lcc2"; },
    .files_beside = lcc2_files,
    .open_levels = open_lcc2,
};

}  // namespace catgs
