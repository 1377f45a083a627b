#pragma once

#include <filesystem>

#include <nlohmann/json_fwd.hpp>

#include "render_core/base/cli_fwd.h"
#include "render_core/base/thread_pool.h"
#include "render_core/scene/tree/build_tree.h"

namespace catgs {

/// Whether a scene of this name is written as a tree.
bool is_tree_name(const std::filesystem::path& path);

struct TreeOptions {
  double memory_gb = 4.0;
};
void add_tree_options(CLI::App& command, TreeOptions& options);

/// Builds the tree with a line of progress and prints what it became. Throws InputError.
void write_tree(const SceneParts& scene, const TreeOptions& options,
                const std::filesystem::path& out, ThreadPool& pool, bool quiet);

/// Describes a tree for `info`, from its header alone.
nlohmann::ordered_json describe_tree(const std::filesystem::path& path, const TreeHeader& header);
void print_tree(const nlohmann::ordered_json& tree);

}  // namespace catgs
