#pragma once

#include <optional>
#include <string>

#include "render_core/base/cli_fwd.h"
#include "render_core/scene/edit/edit_scene.h"

namespace catgs {

/// How a command edits its scene. The options belong to the caller and must outlive the command's
/// callback.
struct EditOptions {
  double scale = 1.0;
  std::optional<std::string> rotate, translate, crop, merge;
  bool remove_floaters = false;
  double keep_fraction = 1.0;
};
void add_edit_options(CLI::App& command, EditOptions& options);

/// Throws InputError that names the option.
SceneEdit edit_of(const EditOptions& options);

/// Prints the effects of an edit, one per line.
void print_counts(const EditCounts& counts);

}  // namespace catgs
