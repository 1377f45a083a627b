#pragma once

#include <map>
#include <set>
#include <string>
#include <string_view>

#include "server/config/config.h"
#include "server/scenes/derived_files.h"
#include "server/scenes/scene_folder.h"
#include "server/scenes/tree_comparison.h"

namespace catgs {

/// Whether scenes look better drawn from their trees or without, in the memory that there is. The
/// answers are kept with the derived files. Session thread only.
class TreeChoices {
 public:
  enum class Choice { unknown, tree, without };

  /// `files`: null: nothing is kept. Both outlive this object.
  TreeChoices(const DerivedFiles* files, const ServerConfig& config)
      : files_(files), config_(config) {}

  [[nodiscard]] Choice of(const FoundScene& scene) const;
  void decide(const FoundScene& scene, const TreeComparison& comparison);
  /// The tree is drawn until the next start, since nothing could be compared with it.
  void take_tree(const FoundScene& scene, std::string_view why);
  /// Forgets all trees but these, which the files do not.
  void keep(const std::set<std::string>& names) {
    std::erase_if(choices_, [&](const auto& of) { return !names.contains(of.first); });
  }

 private:
  [[nodiscard]] std::string name_of(const FoundScene& scene) const;

  const DerivedFiles* const files_;
  const ServerConfig& config_;
  mutable std::map<std::string, Choice> choices_;  // by the tree's name
};

}  // namespace catgs
