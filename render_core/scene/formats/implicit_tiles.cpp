#include "render_core/scene/formats/implicit_tiles.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "render_core/base/error.h"
#include "render_core/scene/formats/gltf_document.h"

namespace catgs {

namespace {

constexpr std::uint64_t max_subtree_bytes = 16 << 20;
constexpr std::uint64_t max_tiles_in_subtree = std::uint64_t{1} << 21;
constexpr std::uint64_t max_levels = 30;  // coordinates have 32 bits

/// A tile by its level and its place there.
struct Position {
  std::uint32_t level = 0;
  std::array<std::uint32_t, 3> at{};
};

/// The tile `levels` below, whose bits of each axis are interleaved in `morton`, x lowest.
Position below(const Position& position, std::uint32_t levels, std::uint64_t morton, int axes) {
  Position found{position.level + levels, position.at};
  for (int k = 0; k < axes; ++k) {
    std::uint32_t& at = found.at[static_cast<std::size_t>(k)];
    at <<= levels;
    for (std::uint32_t bit = 0; bit < levels; ++bit)
      at |= static_cast<std::uint32_t>(
                morton >> (bit * static_cast<std::uint32_t>(axes) + static_cast<std::uint32_t>(k)) &
                1)
            << bit;
  }
  return found;
}

std::string filled_in(std::string uri, const Position& position) {
  const auto fill = [&](std::string_view name, std::uint32_t value) {
    for (std::size_t at; (at = uri.find(name)) != std::string::npos;)
      uri.replace(at, name.size(), std::to_string(value));
  };
  fill("{level}", position.level);
  fill("{x}", position.at[0]);
  fill("{y}", position.at[1]);
  fill("{z}", position.at[2]);
  return uri;
}

/// A flag for each of some tiles.
struct Availability {
  bool constant = false;
  std::vector<std::byte> bits{};  // empty: all are `constant`

  [[nodiscard]] bool operator[](std::uint64_t i) const {
    return bits.empty() ? constant : (bits[i / 8] >> (i % 8) & std::byte{1}) != std::byte{0};
  }
};

struct Subtree {
  Availability tiles, children;
  std::vector<Availability> contents;  // by content
};

class SubtreeReader {
 public:
  SubtreeReader(const FileSet& folder, const std::string& name)
      : beside_(folder, std::filesystem::path(name).parent_path()), file_(folder.open(name)) {}

  /// `tiles`: in the subtree; `children`: places below it.
  Subtree read(std::uint64_t tiles, std::uint64_t children, std::size_t contents) {
    read_document();
    const JsonField root(file_->name(), json_);
    Subtree subtree;
    subtree.tiles = availability(root.at("tileAvailability"), tiles);
    subtree.children = availability(root.at("childSubtreeAvailability"), children);
    const auto field = root.find("contentAvailability");
    for (std::size_t i = 0; field && i < contents; ++i) {
      const bool one = field->value().is_object();
      if (!one && i >= field->size()) break;
      subtree.contents.push_back(availability(one ? *field : (*field)[i], tiles));
    }
    subtree.contents.resize(contents);
    return subtree;
  }

 private:
  /// A binary subtree has a header of 24 bytes, its JSON and its buffer.
  void read_document() {
    constexpr std::size_t header_bytes = 24;
    if (!begins_with(*file_, "subt")) {
      json_ = read_json(*file_, max_subtree_bytes);
      return;
    }
    std::array<std::uint64_t, 3> header;  // magic and version, then two sizes
    file_->read(0, std::as_writable_bytes(std::span(header)));
    if (header[1] > file_->size() - header_bytes)
      throw InputError(file_->name(), "byte 8",
                       fmt::format("{} bytes of JSON are cut off", header[1]));
    json_ = read_json(SliceSource(*file_, header_bytes, header[1]), max_subtree_bytes);
    chunk_at_ = header_bytes + header[1];
  }

  Availability availability(const JsonField& field, std::uint64_t count) {
    if (const auto constant = field.find("constant")) return {constant->count() != 0, {}};
    const auto stream = field.find("bitstream");
    const JsonField index = stream ? *stream : field.at("bufferView");
    const JsonField views = JsonField(file_->name(), json_).at("bufferViews");
    if (index.count() >= views.size()) index.fail("names no buffer view");
    const JsonField view = views[index.count()];
    const JsonField buffers = JsonField(file_->name(), json_).at("buffers"), of = view.at("buffer");
    if (of.count() >= buffers.size()) of.fail("names no buffer");
    const auto offset = view.find("byteOffset");
    const std::uint64_t bytes = (count + 7) / 8, begin = offset ? offset->count() : 0;
    if (view.at("byteLength").count() < bytes)
      view.fail(fmt::format("has fewer than {} bytes, a bit for each tile", bytes));
    Availability bits{false, std::vector<std::byte>(bytes)};
    const auto uri = buffers[of.count()].find("uri");
    const auto outside = uri ? beside_.open(unescaped(uri->text())) : nullptr;
    const ByteSource& source = outside ? *outside : *file_;
    const std::uint64_t first = outside ? 0 : chunk_at_;
    if (begin > source.size() - first) view.fail("begins behind the end of its buffer");
    source.read(first + begin, bits.bits);
    return bits;
  }

  FilesBelow beside_;
  std::unique_ptr<ByteSource> file_;
  nlohmann::json json_;
  std::uint64_t chunk_at_ = 0;  // of the binary buffer
};

struct Scheme {
  int axes = 2;
  std::uint32_t levels = 0, subtree_levels = 0;
  std::uint64_t branches = 4, tiles = 0, children = 0;  // of a subtree
  std::string subtree_uri;
  std::vector<std::string> content_uris;
};

std::uint32_t levels_of(const JsonField& field) {
  if (field.count() < 1 || field.count() > max_levels)
    field.fail(fmt::format("is not in 1…{}", max_levels));
  return static_cast<std::uint32_t>(field.count());
}

Scheme parse_scheme(const JsonField& tile) {
  const JsonField implicit = tile.at("implicitTiling"), word = implicit.at("subdivisionScheme");
  Scheme scheme;
  if (word.text() == "OCTREE")
    scheme.axes = 3, scheme.branches = 8;
  else if (word.text() != "QUADTREE")
    word.fail("is neither QUADTREE nor OCTREE");
  const auto levels = implicit.find("availableLevels");
  scheme.levels = levels_of(levels ? *levels : implicit.at("maximumLevel"));
  if (!levels) ++scheme.levels;
  scheme.subtree_levels = levels_of(implicit.at("subtreeLevels"));
  scheme.children = 1;
  for (std::uint32_t level = 0; level < scheme.subtree_levels; ++level) {
    scheme.tiles += scheme.children;
    scheme.children *= scheme.branches;
    if (scheme.children > max_tiles_in_subtree)
      implicit.at("subtreeLevels")
          .fail(fmt::format("stands for more than {} tiles", max_tiles_in_subtree));
  }
  scheme.subtree_uri = implicit.at("subtrees").at("uri").text();
  if (const auto content = tile.find("content"))
    scheme.content_uris.push_back(content->at("uri").text());
  if (const auto contents = tile.find("contents"))
    for (std::size_t i = 0; i < contents->size(); ++i)
      scheme.content_uris.push_back((*contents)[i].at("uri").text());
  return scheme;
}

/// A tile of a level of a subtree.
struct Open {
  std::size_t tile = 0;  // its index in the result
  std::uint64_t morton = 0;
};

struct Waiting {
  Position root;
  std::optional<std::size_t> above;
};

class Expansion {
 public:
  Expansion(const JsonField& tile, const FileSet& folder, std::size_t most)
      : tile_(tile), folder_(folder), most_(most), scheme_(parse_scheme(tile)) {}

  std::vector<ImplicitTile> expanded() {
    waiting_.push_back({{}, {}});
    while (!waiting_.empty()) {
      const Waiting next = waiting_.front();
      waiting_.pop_front();
      expand(next);
    }
    return std::move(tiles_);
  }

 private:
  std::optional<Open> add(const Subtree& subtree, const Waiting& in, std::uint32_t level,
                          std::uint64_t first, std::uint64_t morton,
                          const std::optional<std::size_t>& above) {
    if (!subtree.tiles[first + morton]) return std::nullopt;
    if (tiles_.size() == most_) tile_.fail(fmt::format("stands for more than {} tiles", most_));
    ImplicitTile tile{above, {}};
    const Position position = below(in.root, level, morton, scheme_.axes);
    for (std::size_t i = 0; i < subtree.contents.size(); ++i)
      if (subtree.contents[i][first + morton])
        tile.contents.push_back(filled_in(scheme_.content_uris[i], position));
    tiles_.push_back(std::move(tile));
    return Open{tiles_.size() - 1, morton};
  }

  void expand(const Waiting& in) {
    const std::string name =
        FilesBelow::name_of({}, unescaped(filled_in(scheme_.subtree_uri, in.root)));
    const Subtree subtree = SubtreeReader(folder_, name)
                                .read(scheme_.tiles, scheme_.children, scheme_.content_uris.size());
    std::vector<Open> level;
    if (const auto root = add(subtree, in, 0, 0, 0, in.above)) level.push_back(*root);
    std::uint64_t first = 1, wide = scheme_.branches;
    for (std::uint32_t depth = 1; depth < scheme_.subtree_levels; ++depth) {
      if (in.root.level + depth >= scheme_.levels) return;
      std::vector<Open> next;
      for (const Open& open : level)
        for (std::uint64_t child = 0; child < scheme_.branches; ++child)
          if (const auto added =
                  add(subtree, in, depth, first, open.morton * scheme_.branches + child, open.tile))
            next.push_back(*added);
      level = std::move(next);
      first += wide;
      wide *= scheme_.branches;
    }
    if (in.root.level + scheme_.subtree_levels >= scheme_.levels) return;
    for (const Open& open : level)
      for (std::uint64_t child = 0; child < scheme_.branches; ++child) {
        const std::uint64_t morton = open.morton * scheme_.branches + child;
        if (subtree.children[morton])
          waiting_.push_back(
              {below(in.root, scheme_.subtree_levels, morton, scheme_.axes), open.tile});
      }
  }

  const JsonField& tile_;
  const FileSet& folder_;
  const std::size_t most_;
  const Scheme scheme_;
  std::vector<ImplicitTile> tiles_;
  std::deque<Waiting> waiting_;
};

}  // namespace

std::vector<ImplicitTile> read_implicit_tiles(const JsonField& tile, const FileSet& folder,
                                              std::size_t most) {
  return Expansion(tile, folder, most).expanded();
}

}  // namespace catgs
