#include "render_core/scene/tree/read_tree.h"

#include <algorithm>
#include <cstdint>
#include <span>
#include <utility>

#include <fmt/format.h>
#include <glm/common.hpp>

#include "render_core/base/error.h"
#include "render_core/scene/formats/format_limits.h"
#include "render_core/scene/formats/scene_format.h"

namespace catgs {
namespace {

constexpr std::size_t nodes_at_a_time = 16;  // the last row of a page
constexpr float least_scale = 1e-10f;        // as in sanitize()

void read_node(const TreePage& page, std::size_t slot, GaussianCloud& cloud, std::size_t first) {
  const NodeFacts& facts = page.facts(slot);
  std::vector<math::CovarianceFactor<double>> factors(facts.count);
  unpack_cluster(page.block(slot), facts.units, facts.count, cloud, first, factors);
  for (std::size_t i = 0; i < factors.size(); ++i) {
    const GaussianAxes axes = axes_of(factors[i]);
    cloud.rotation[first + i] = axes.rotation;
    cloud.scale[first + i] = glm::max(axes.scale, least_scale);
  }
}

/// Calls visit(page, slot, n) for each node n of `nodes`. Reads a page once for all that follow
/// each other. Throws InputError if it is damaged.
template <class Visit>
void for_each_node(TreeFile& tree, std::span<const NodeId> nodes, const LoadContext& context,
                   const Visit& visit) {
  const TreeShape& shape = tree.shape();
  context.for_blocks(nodes.size(), nodes_at_a_time, [&](auto begin, auto end) {
    std::unique_ptr<const TreePage> page;
    for (std::size_t n = begin; n < end; ++n) {
      const std::uint64_t number = shape.page_of(nodes[n]);
      if (n == begin || number != shape.page_of(nodes[n - 1])) page = tree.page(number);
      if (!page) throw InputError("", "", tree.damage().first);
      visit(*page, shape.slot_of(nodes[n]), n);
    }
  });
}

}  // namespace

void require_root(const TreeFile& tree) {
  try {
    (void)tree.read(0);
  } catch (const InputError& error) {
    throw InputError(tree.name(), "page 0",
                     fmt::format("nothing can be seen without it: {}", error.what()));
  }
}

GaussianCloud read_nodes(TreeFile& tree, std::span<const NodeId> nodes,
                         const LoadContext& context) {
  std::vector<std::size_t> first(nodes.size() + 1, 0);
  for_each_node(tree, nodes, context.part(0.0, 0.5), [&](const auto& page, auto slot, auto n) {
    first[n + 1] = page.facts(slot).count;
  });
  for (std::size_t n = 0; n < nodes.size(); ++n) first[n + 1] += first[n];
  GaussianCloud cloud;
  cloud.resize(first.back(), tree.shape().sh_degree());
  cloud.model = tree.model();
  for_each_node(tree, nodes, context.part(0.5, 1.0), [&](const auto& page, auto slot, auto n) {
    read_node(page, slot, cloud, first[n]);
  });
  return cloud;
}

namespace {

/// The finest level whose Gaussians may be read in pages down to it, and which is the last one of
/// its pages. The root's pages may always be read.
int finest_level(const TreeShape& shape, std::uint64_t most) {
  int band = 0;
  while (band + 1 < shape.bands() &&
         std::uint64_t{shape.nodes_on(band * shape.page_levels())} * cluster_size > most)
    ++band;
  return band * shape.page_levels();
}

}  // namespace

TreeScene read_tree(TreeFile& tree, std::uint64_t most_gaussians, const LoadContext& context) {
  const TreeShape& shape = tree.shape();
  const int finest = finest_level(shape, most_gaussians);
  // Pages are numbered from the root's on, level by level.
  const std::uint64_t wanted =
      shape.page_of({static_cast<std::uint8_t>(finest), shape.nodes_on(finest) - 1}) + 1;
  // Without cameras no facts are looked at, only whether a page is there.
  std::vector<char> sound(wanted);
  context.part(0.0, 0.4).for_blocks(
      std::min(wanted, tree.pages_in_file()), 1,
      [&](auto page, auto) { sound[page] = tree.page(page) != nullptr; });
  const std::vector<NodeFacts> unseen(shape.slots());
  const Cut all = choose_cut(shape, {}, 0.0f, [&](std::uint64_t page) -> PageInMemory {
    return {page < wanted && sound[page] ? unseen.data() : nullptr};
  });
  const std::string first = tree.damage().first;
  if (all.drawn.empty()) require_root(tree);
  std::vector<NodeId> nodes;
  for (const DrawnNode& drawn : all.drawn) nodes.push_back(drawn.node);
  TreeScene scene;
  scene.origin = tree.header().origin;
  scene.cloud = read_nodes(tree, nodes, context.part(0.4, 1.0));
  if (const auto lost = std::ranges::count(sound, 0); lost > 0)
    scene.notes.push_back(
        fmt::format("{} of {} pages are damaged or missing and show less detail{}{}", lost, wanted,
                    first.empty() ? "" : "; the first: ", first));
  return scene;
}

TreeScene read_tree(std::unique_ptr<const ByteSource> file, const LoadContext& context) {
  TreeFile tree(std::move(file));
  if (tree.shape().gaussians() > max_gaussians)
    throw InputError(tree.name(), "",
                     fmt::format("has {} Gaussians, at most {} are loaded at once",
                                 tree.shape().gaussians(), max_gaussians),
                     "give --detail, so that only what a picture needs is in memory");
  return read_tree(tree, max_gaussians, context);
}

constexpr SceneFormat tree_format = {
    .name = "tree",
    .extensions = {".tree"},
    .in_pages = true,
    .keeps_antialiased = true,
    .keeps_surfels = true,
    .keeps_origin = true,
    .is_mine = [](const ByteSource& file, std::string_view) { return is_tree(file); },
    .size = [](const SceneFiles& files) -> SceneSize {
      const TreeHeader header = read_tree_header(FileSource(files.path));
      return {header.gaussians, static_cast<int>(header.sh_degree), true};
    },
    .read = [](const SceneFiles& files, const LoadContext& context) -> DecodedScene {
      TreeScene tree = read_tree(std::make_unique<FileSource>(files.path), context);
      return {"tree", std::move(tree.cloud), std::move(tree.notes), {}, tree.origin};
    },
};

}  // namespace catgs
