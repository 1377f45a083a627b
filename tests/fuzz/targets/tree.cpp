#include <algorithm>
#include <cstring>
#include <vector>

#include "render_core/scene/tree/cut.h"
#include "render_core/scene/tree/read_tree.h"
#include "tests/fuzz/target.h"
#include "tests/render_core/scene/random_cloud.h"
#include "tests/render_core/scene/tree/tree_test_support.h"

namespace catgs::fuzz {
namespace {

// A page has 250 KB, nearly all of them zeros, and checksums would refuse nearly every mutant. An
// input is therefore the header and then pieces of the pages, each with its place in the file and
// its length. The checksums are written here.
struct Piece {
  std::uint32_t offset, size;
};
constexpr std::uint32_t most_bytes = 1 << 20;
constexpr std::uint32_t least_gap = 64;  // zeros that are worth a piece

std::string expanded(Bytes input) {
  std::string file(TreeShape::header_bytes, '\0');
  const std::size_t header = std::min(input.size(), sizeof(TreeHeader));
  std::memcpy(file.data(), input.data(), header);
  input = input.subspan(header);
  while (input.size() >= sizeof(Piece)) {
    const auto piece = load_as<Piece>(input.data());
    input = input.subspan(sizeof(Piece));
    const std::size_t size = std::min<std::size_t>(piece.size, input.size());
    if (piece.offset < most_bytes) {
      const std::size_t at = TreeShape::header_bytes + piece.offset;
      if (file.size() < at + size) file.resize(at + size);
      std::memcpy(file.data() + at, input.data(), size);
    }
    input = input.subspan(size);
  }
  return file;
}

void seal(std::string& file) {
  TreeHeader header;
  std::memcpy(&header, file.data(), sizeof header);
  header.checksum = header.right_checksum();
  std::memcpy(file.data(), &header, sizeof header);
  if (header.gaussians == 0 || header.gaussians > TreeShape::max_gaussians || header.sh_degree > 3)
    return;
  const TreeShape shape(header.gaussians, static_cast<int>(header.sh_degree));
  TreePage page(shape);
  for (std::uint64_t p = 0; p < shape.pages() && shape.page_offset(p) < file.size(); ++p) {
    // The last page that a piece begins in is there as a whole.
    if (file.size() < shape.page_offset(p + 1)) file.resize(shape.page_offset(p + 1));
    std::memcpy(page.bytes().data(), file.data() + shape.page_offset(p), page.bytes().size());
    page.seal(p);
    std::memcpy(file.data() + shape.page_offset(p), page.bytes().data(), page.bytes().size());
  }
}

/// The shares of all nodes that stand for a leaf are no more than one leaf.
void require_sound_cut(TreeFile& tree) {
  const TreeShape& shape = tree.shape();
  const Camera camera = make_camera({}, {64, 48}, 50.0f);
  std::vector<std::shared_ptr<const TreePage>> pages(tree.pages_in_file());
  for (std::uint64_t p = 0; p < pages.size(); ++p) pages[p] = tree.page(p);
  const Cut cut =
      choose_cut(shape, std::span(&camera, 1), 1.0f, [&](std::uint64_t page) -> PageInMemory {
        return {page < pages.size() && pages[page] ? &pages[page]->facts(0) : nullptr};
      });
  std::vector<float> shares(shape.leaves());
  for (const auto& [node, share] : cut.drawn) {
    require(share > 0.0f, "a node that is drawn has a share");
    const std::uint64_t first = std::uint64_t{node.index} << node.level;
    const std::uint64_t end = std::min<std::uint64_t>(shape.leaves(), first + (1ull << node.level));
    for (std::uint64_t leaf = first; leaf < end; ++leaf) shares[leaf] += share;
  }
  for (const float share : shares) require(share < 1.001f, "no leaf is drawn twice");
}

void parse_tree(Bytes input) {
  std::string file = expanded(input);
  seal(file);
  TreeFile tree(test::source_of(file));
  require_sound_cut(tree);
  const TreeScene scene = read_tree(test::source_of(file), one_thread());
  require(scene.cloud.size() <= tree.shape().gaussians(),
          "scenes take no more room than they said");
  for (const glm::vec3& scale : scene.cloud.scale)
    require(scale.x > 0.0f && scale.y > 0.0f && scale.z > 0.0f, "Gaussians have a size");
  require_sound(scene.cloud);
}

/// The inverse of expanded().
std::string in_pieces(const std::string& file) {
  std::string out = file.substr(0, sizeof(TreeHeader));
  const auto used = [&](std::size_t i) { return file[i] != '\0'; };
  for (std::size_t at = TreeShape::header_bytes; at < file.size(); ++at) {
    if (!used(at)) continue;
    std::size_t end = at + 1;
    for (std::size_t i = end; i < file.size() && i < end + least_gap; ++i)
      if (used(i)) end = i + 1;
    const Piece piece{static_cast<std::uint32_t>(at - TreeShape::header_bytes),
                      static_cast<std::uint32_t>(end - at)};
    out.append(reinterpret_cast<const char*>(&piece), sizeof piece);
    out.append(file, at, end - at);
    at = end;
  }
  return out;
}

std::map<std::string, std::string> tree_seeds() {
  static ThreadPool pool(1);
  const auto seed = [&](std::size_t count, int degree) {
    return in_pieces(test::tree_bytes(test::random_cloud(count, degree), pool));
  };
  return {{"five", seed(5, 0)}, {"five_sh", seed(5, 3)}, {"two_leaves", seed(260, 0)}};
}

}  // namespace

std::vector<Target> tree_targets() {
  return {{.name = "tree",
           .parse = parse_tree,
           .seeds = tree_seeds,
           .dictionary = {"catgstre", std::string("\0\0\x80\x7f", 4),
                          std::string("\0\0\0\x40\x04\0\0\0", 8), std::string("\0\1\0\0", 4)},
           .max_bytes = 24576}};
}

}  // namespace catgs::fuzz
