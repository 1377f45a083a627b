#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <utility>
#include <vector>

#include "render_core/cpu/page_slots.h"
#include "render_core/cuda/page_upload.h"
#include "render_core/scene/tree/cut.h"
#include "render_core/scene/tree/read_tree.h"
#include "tests/fuzz/target.h"
#include "tests/render_core/scene/random_cloud.h"
#include "tests/render_core/scene/tree/tree_test_support.h"

namespace catgs::fuzz {
namespace {

// A page has 250 KB, nearly all of them zeros, and checksums would refuse nearly every mutant. An
// input is therefore the header and then pieces of the pages, each with its place in the file and
// its length. The checksums are written here, behind all changes. Pages of a tree with the size and
// degree of one of whole_trees() are its pages where no piece lies.
struct Piece {
  std::uint32_t offset, size;
};
constexpr std::uint32_t most_bytes = 1 << 20;
constexpr std::uint32_t least_gap = 64;  // zeros that are worth a piece

/// Trees of several pages, of which some slots are unused.
const std::vector<std::string>& whole_trees() {
  static const std::vector<std::string> trees = [] {
    ThreadPool pool(1);
    return std::vector{test::tree_bytes(test::random_cloud(17 * cluster_size + 3, 0), pool),
                       test::tree_bytes(test::random_cloud(9 * cluster_size + 3, 3), pool)};
  }();
  return trees;
}

TreeHeader header_of(const std::string& file) { return load_as<TreeHeader>(bytes_of(file).data()); }

std::string expanded(Bytes input) {
  std::string file(TreeShape::header_bytes, '\0');
  const std::size_t header = std::min(input.size(), sizeof(TreeHeader));
  std::memcpy(file.data(), input.data(), header);
  for (const std::string& whole : whole_trees())
    if (header_of(file).gaussians == header_of(whole).gaussians &&
        header_of(file).sh_degree == header_of(whole).sh_degree)
      file += whole.substr(TreeShape::header_bytes);
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
  TreeHeader header = header_of(file);
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

/// The pages of a tree in the memory of both cores.
struct Stores {
  explicit Stores(TreeFile& tree)
      : table(tree.shape()),
        on_host(tree.shape(), tree.model(), static_cast<std::uint32_t>(tree.pages_in_file())),
        errors(tree.pages_in_file() * cuda::clusters_per_slot),
        clusters(errors.size()) {}

  void put(std::shared_ptr<PageInSlot> held, const TreePage& page) {
    const TreeShape& shape = table.shape();
    for (std::size_t s = 0; s < shape.slots(); ++s) held->facts.push_back(page.facts(s));
    on_host.put(held->slot, page, held->page);
    const cuda::PageUpload upload(shape, page, held->page);
    std::ranges::copy(upload.errors, &errors[held->slot * cuda::clusters_per_slot]);
    std::ranges::copy(upload.clusters, &clusters[held->slot * cuda::clusters_per_slot]);
    table.add(std::move(held));
  }

  PageTable table;
  PageSlots on_host;
  std::vector<float> errors;  // as on the device
  std::vector<Cluster> clusters;
};

/// Puts each page whose family is whole, below the page above, as PagedTree does.
void fill(Stores& stores, TreeFile& tree) {
  const TreeShape& shape = tree.shape();
  std::uint32_t size = 0;
  for (std::uint64_t first = 0; first < tree.pages_in_file(); first += size) {
    size = family_size(shape, first);
    const NodeFacts* above = stores.table.facts_above(first);
    if (first > 0 && !above) continue;
    std::vector<std::unique_ptr<const TreePage>> family;
    for (std::uint64_t p = first; p < first + size; ++p) family.push_back(tree.page(p, above));
    if (!std::ranges::all_of(family, [](const auto& page) { return page != nullptr; })) continue;
    for (std::uint32_t i = 0; i < size; ++i) {
      auto held = std::make_shared<PageInSlot>();
      held->page = first + i;
      held->slot = static_cast<std::uint32_t>(stores.table.size());
      stores.put(std::move(held), *family[i]);
    }
  }
}

/// What the cores' frames read of their stores is finite and within them.
void require_sound_stores(TreeFile& tree) {
  Stores stores(tree);
  fill(stores, tree);
  const auto& table = stores.table;
  const auto finite = [](const Cluster& c) {
    return std::isfinite(c.centre.x + c.centre.y + c.centre.z) && std::isfinite(c.reach) &&
           std::isfinite(c.half_extent.x + c.half_extent.y + c.half_extent.z);
  };
  for (const auto& page : table.pages())
    for_each_node_in(table.shape(), page->page, [&](NodeId node) {
      const std::uint32_t c = table.cluster_of(node, table.shape().slots());
      require(finite(stores.on_host.store().clusters()[c]), "bounds on the host are finite");
      require(finite(stores.clusters[table.cluster_of(node, cuda::clusters_per_slot)]),
              "bounds on the device are finite");
    });
  const std::vector<cuda::PageEntry> entries = cuda::entries_of(table);
  const Camera camera = make_camera({}, {64, 48}, 50.0f);
  const cuda::TreeCut cut{
      .tree = {entries.data(), static_cast<std::uint32_t>(entries.size()), stores.errors.data()},
      .now = CutEye(camera),
      .end = CutEye(camera),
      .detail_px = 1.0f,
      .now_s = 1.0,
      .share = nullptr};
  for (std::uint32_t n = 0; n < cut.tree.nodes(); ++n) {
    const float share = cut.share_of(stores.clusters.data(), n);
    require(share >= 0.0f && share <= 1.0f, "a share on the device is a share");
    if (share > 0.0f)
      require(cut.level_of(n) < static_cast<std::uint32_t>(table.shape().levels()),
              "nodes that the device draws are on levels");
  }
}

void parse_tree(Bytes input) {
  std::string file = expanded(input);
  seal(file);
  TreeFile tree(test::source_of(file));
  require_sound_cut(tree);
  require_sound_stores(tree);
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
  std::map<std::string, std::string> seeds = {
      {"five", seed(5, 0)}, {"five_sh", seed(5, 3)}, {"two_leaves", seed(260, 0)}};
  for (const std::string& whole : whole_trees())
    seeds["pages_" + std::to_string(header_of(whole).sh_degree)] =
        whole.substr(0, sizeof(TreeHeader));
  return seeds;
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
