#include "server/scenes/tree_choices.h"

#include <optional>

#include <fmt/format.h>

#include "render_core/base/error.h"
#include "server/base/log_event.h"
#include "server/scenes/scene_catalog.h"

namespace catgs {
namespace {

constexpr std::size_t most_bytes_of_choice = 16;
constexpr std::string_view tree_text = "tree\n", without_text = "without\n";

void check_choice(const ByteSource& file) {
  const auto bytes = file.read_all(most_bytes_of_choice);
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (text != tree_text && text != without_text)
    throw InputError(file.name(), {}, "is no kept choice");
}

}  // namespace

/// The answer is for this tree, in this memory and with this detail.
std::string TreeChoices::name_of(const FoundScene& scene) const {
  constexpr int version = 1;  // of how trees are drawn and compared
  const std::string facts =
      fmt::format("{}\n{} {} {}", scene.tree, tree_memory(config_), config_.detail_px, version);
  return derived_name(scene.location, facts, ".choice");
}

TreeChoices::Choice TreeChoices::of(const FoundScene& scene) const {
  if (!files_ || scene.tree.empty()) return Choice::unknown;
  const auto [known, is_new] = choices_.try_emplace(scene.tree, Choice::unknown);
  if (!is_new) return known->second;
  if (const auto text = files_->read(name_of(scene), most_bytes_of_choice, check_choice))
    known->second = *text == tree_text ? Choice::tree : Choice::without;
  return known->second;
}

void TreeChoices::decide(const FoundScene& scene, const TreeComparison& comparison) {
  const bool tree = comparison.tree_is_good();
  log_info({.event = "tree_compared", .scene = scene.id},
           "scene {}: pictures have {}: it is drawn {}", scene.id,
           comparison.fits ? fmt::format("{:.1f} dB from its tree and {:.1f} dB without",
                                         comparison.tree_db, comparison.levels_db)
                           : "no part whose tree fits into memory",
           tree ? "from its tree" : "without");
  choices_[scene.tree] = tree ? Choice::tree : Choice::without;
  if (files_)
    files_->write(name_of(scene), std::string(tree ? tree_text : without_text),
                  DerivedFiles::most_choices);
}

void TreeChoices::take_tree(const FoundScene& scene, std::string_view why) {
  log_warning({.event = "tree_not_compared", .scene = scene.id},
              "scene {}: it is drawn from its tree, which is compared with nothing: {}", scene.id,
              why);
  choices_[scene.tree] = Choice::tree;
}

}  // namespace catgs
