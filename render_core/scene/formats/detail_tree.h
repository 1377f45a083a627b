#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "render_core/base/error.h"
#include "render_core/scene/formats/load_context.h"
#include "render_core/scene/gaussian_cloud.h"

namespace catgs {

// 3D Tiles and LCC2 are trees: a node's Gaussians are a coarse picture of what its children show.

struct DetailNode {
  std::size_t count = 0;  // Gaussians of its own; 0: it only holds others
  bool adds = false;      // its own are shown beside those of its children, not in their place
  int depth = 0;          // nodes with Gaussians above it
  std::vector<std::size_t> children;  // their indices, all larger than its own
};

struct DetailTree {
  std::vector<DetailNode> nodes;  // 0 is the root

  /// Adds a node below `above`, or the root. Returns its index.
  std::size_t add(std::optional<std::size_t> above, bool adds);
  /// The node has `count` Gaussians more. Before nodes are added below it.
  void add_gaussians(std::size_t node, std::size_t count) { nodes[node].count += count; }
  /// Level 0 is the finest: all leaves. Level `levels() - 1` shows the root's Gaussians.
  [[nodiscard]] int levels() const;
};

/// Nodes that together show the whole scene once.
struct DetailChoice {
  std::vector<std::size_t> nodes;
  std::size_t count = 0;  // of their Gaussians
  std::string text;       // for people: "level 2 of 0…6"
};

/// Throws InputError that names `file` if both are given, or if there is no such level.
void require_level(const std::string& file, int levels, std::optional<int> level,
                   std::optional<std::size_t> budget);
/// The budget is less than the coarsest level has.
struct BudgetTooSmall : InputError {
  BudgetTooSmall(const InputError& error, std::size_t least) : InputError(error), coarsest(least) {}
  std::size_t coarsest;  // Gaussians
};
/// Throws BudgetTooSmall.
[[noreturn]] void fail_budget(const std::string& file, std::size_t budget, std::size_t coarsest);

/// Level `level`, or the finest one whose Gaussians fit into `budget`. As many nodes as still fit
/// then give way to the next finer level, cheapest first. Without both the finest level. `always`:
/// Gaussians that every level has besides. Throws InputError that names `file`: both are given,
/// there is no such level, the coarsest one exceeds the budget.
DetailChoice choose_detail(const DetailTree& tree, const std::string& file,
                           std::optional<int> level, std::optional<std::size_t> budget,
                           std::size_t always = 0);

/// A scene with levels of detail, of which some were chosen. Its headers were read and checked.
struct OpenLevels {
  std::string format;  // as Scene::format
  int levels = 0;
  int sh_degree = 0;
  std::size_t count = 0;           // Gaussians of the chosen levels, at least 1
  std::vector<std::string> notes;  // for people
  std::size_t parts = 0;
  /// The Gaussians of a part with the SH degree of the whole, not sanitized, about `origin`. Keeps
  /// what it reads from. Throws InputError.
  std::function<GaussianCloud(std::size_t part, const glm::dvec3& origin, const LoadContext&)> read;
  /// All parts, if the format can read them at once; else null.
  std::function<GaussianCloud(const glm::dvec3& origin, const LoadContext&)> read_all{};
};

/// All parts, one after the other. The model is that of the largest part.
GaussianCloud read_levels(const OpenLevels& scene, const LoadContext& context,
                          const glm::dvec3& origin = glm::dvec3(0.0));

}  // namespace catgs
