#include "render_core/scene/formats/detail_tree.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/scene/copy_gaussians.h"

namespace catgs {

namespace {

/// The nodes that show the scene where the nodes of `refined` give way to their children.
DetailChoice shown(const DetailTree& tree, const std::vector<bool>& refined) {
  DetailChoice choice;
  std::vector<std::size_t> open = {0};  // the next one last
  while (!open.empty()) {
    const std::size_t index = open.back();
    open.pop_back();
    const DetailNode& node = tree.nodes[index];
    const bool opens = (node.count == 0 || refined[index]) && !node.children.empty();
    if (node.count > 0 && (node.adds || !opens)) {
      choice.nodes.push_back(index);
      choice.count += node.count;
    }
    if (opens) open.insert(open.end(), node.children.rbegin(), node.children.rend());
  }
  return choice;
}

/// For each node the Gaussians of the nearest ones below it.
std::vector<std::size_t> counts_below(const DetailTree& tree) {
  std::vector<std::size_t> below(tree.nodes.size());
  for (std::size_t n = below.size(); n-- > 0;)
    for (const std::size_t child : tree.nodes[n].children)
      below[n] += tree.nodes[child].count > 0 ? tree.nodes[child].count : below[child];
  return below;
}

/// The nodes that give way to their children on a level: those above it that have Gaussians below.
std::vector<bool> refined_at(const DetailTree& tree, int level) {
  const int depth = tree.levels() - 1 - level;
  const std::vector<std::size_t> below = counts_below(tree);
  std::vector<bool> refined(tree.nodes.size());
  for (std::size_t n = 0; n < refined.size(); ++n)
    refined[n] = tree.nodes[n].depth < depth && below[n] > 0;
  return refined;
}

/// Refines nodes of `choice` by one level more while the Gaussians fit into `budget`.
DetailChoice refine_further(const DetailTree& tree, const DetailChoice& choice,
                            std::vector<bool> refined, std::size_t budget) {
  const std::vector<std::size_t> below = counts_below(tree);
  std::vector<std::pair<std::size_t, std::size_t>> costs;  // additional Gaussians, node
  for (const std::size_t n : choice.nodes) {
    const DetailNode& node = tree.nodes[n];
    if (refined[n] || below[n] == 0) continue;
    const std::size_t then = node.adds ? node.count + below[n] : below[n];
    costs.emplace_back(then > node.count ? then - node.count : 0, n);
  }
  std::sort(costs.begin(), costs.end());
  std::size_t room = budget - choice.count;
  for (const auto& [cost, n] : costs) {
    if (cost > room) break;
    room -= cost;
    refined[n] = true;
  }
  return shown(tree, refined);
}

DetailChoice within_budget(const DetailTree& tree, const std::string& file, std::size_t budget,
                           std::size_t always) {
  const std::size_t room = budget > always ? budget - always : 0;
  int level = tree.levels() - 1;
  DetailChoice choice = shown(tree, refined_at(tree, level));
  if (choice.count > room) fail_budget(file, budget, choice.count + always);
  for (; level > 0; --level) {
    DetailChoice finer = shown(tree, refined_at(tree, level - 1));
    if (finer.count > room) break;
    choice = std::move(finer);
  }
  const std::size_t whole_level = choice.count;
  if (level > 0) choice = refine_further(tree, choice, refined_at(tree, level), room);
  choice.text = choice.count == whole_level
                    ? fmt::format("level {} of 0…{}", level, tree.levels() - 1)
                    : fmt::format("levels {} and {} of 0…{}", level - 1, level, tree.levels() - 1);
  return choice;
}

}  // namespace

std::size_t DetailTree::add(std::optional<std::size_t> above, bool adds) {
  DetailNode node;
  node.adds = adds;
  if (above) {
    node.depth = nodes[*above].depth + (nodes[*above].count > 0 ? 1 : 0);
    nodes[*above].children.push_back(nodes.size());
  }
  nodes.push_back(std::move(node));
  return nodes.size() - 1;
}

int DetailTree::levels() const {
  int deepest = 0;
  for (const DetailNode& node : nodes)
    if (node.count > 0) deepest = std::max(deepest, node.depth);
  return deepest + 1;
}

void require_level(const std::string& file, int levels, std::optional<int> level,
                   std::optional<std::size_t> budget) {
  if (level && budget)
    throw InputError(file, "", "a level and a Gaussian budget were both given", "give one");
  if (level && (*level < 0 || *level >= levels))
    throw InputError(file, "level of detail",
                     fmt::format("there is no level {}; 0 (finest) to {} are", *level, levels - 1));
}

void fail_budget(const std::string& file, std::size_t budget, std::size_t coarsest) {
  throw BudgetTooSmall(
      InputError(file, "Gaussian budget",
                 fmt::format("{} is less than the {} of the coarsest level", budget, coarsest),
                 "raise the budget"),
      coarsest);
}

DetailChoice choose_detail(const DetailTree& tree, const std::string& file,
                           std::optional<int> level, std::optional<std::size_t> budget,
                           std::size_t always) {
  const int levels = tree.levels(), wanted = level.value_or(0);
  require_level(file, levels, level, budget);
  if (budget) return within_budget(tree, file, *budget, always);
  DetailChoice choice = shown(tree, refined_at(tree, wanted));
  choice.text = fmt::format("level {} of 0…{}", wanted, levels - 1);
  return choice;
}

GaussianCloud read_levels(const OpenLevels& scene, const LoadContext& context,
                          const glm::dvec3& origin) {
  if (scene.read_all) return scene.read_all(origin, context);
  if (scene.parts == 1) return scene.read(0, origin, context);
  GaussianCloud whole;
  whole.resize(scene.count, scene.sh_degree);
  const auto parts = static_cast<double>(scene.parts);
  std::size_t done = 0, largest = 0;
  for (std::size_t i = 0; i < scene.parts; ++i) {
    const auto part_number = static_cast<double>(i);
    const GaussianCloud part =
        scene.read(i, origin, context.part(part_number / parts, (part_number + 1.0) / parts));
    copy_gaussians(part, done, whole);
    if (part.size() > largest) whole.model = part.model;
    largest = std::max(largest, part.size());
    done += part.size();
  }
  return whole;
}

}  // namespace catgs
