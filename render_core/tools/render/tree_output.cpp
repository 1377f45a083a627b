#include "render_core/tools/render/tree_output.h"

#include <chrono>
#include <cmath>
#include <string>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "render_core/base/error.h"
#include "render_core/base/printable.h"
#include "render_core/scene/files/hints.h"
#include "render_core/tools/progress.h"

namespace catgs {

bool is_tree_name(const std::filesystem::path& path) { return path.extension() == ".tree"; }

void add_tree_options(CLI::App& command, TreeOptions& options) {
  command
      .add_option("--memory", options.memory_gb,
                  "For a .tree: GB in which Gaussians are sorted; more of them are sorted on disk")
      ->capture_default_str();
}

void write_tree(const SceneParts& scene, const TreeOptions& options,
                const std::filesystem::path& out, ThreadPool& pool, bool quiet) {
  if (!(options.memory_gb >= 0.0 && options.memory_gb <= 1e6))
    throw InputError("--memory", "", fmt::format("{} is not a number of GB", options.memory_gb),
                     "0 to 1000000");
  const auto start = std::chrono::steady_clock::now();
  TreeHeader header;
  {
    Progress progress("building", quiet);
    const LoadContext context(pool, [&](double fraction) { progress.update(fraction); });
    header =
        build_tree(scene, out, static_cast<std::size_t>(options.memory_gb * 1e9), pool, context);
  }
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
  const auto count = static_cast<double>(header.gaussians);
  const auto bytes = static_cast<double>(std::filesystem::file_size(out));
  fmt::print("{}: {} Gaussians, {:.1f} MB, {:.1f} bytes each, built in {:.1f} s\n", out.string(),
             header.gaussians, 1e-6 * bytes, bytes / count, elapsed.count());
}

nlohmann::ordered_json describe_tree(const std::filesystem::path& path, const TreeHeader& header) {
  using Json = nlohmann::ordered_json;
  const TreeShape shape(header.gaussians, static_cast<int>(header.sh_degree));
  const auto bytes = std::filesystem::file_size(path);
  Json levels = Json::array();
  for (int l = shape.levels() - 1; l >= 0; --l) {
    const TreeLevel& level = header.levels[static_cast<std::size_t>(l)];
    levels.push_back({{"level", l},
                      {"nodes", shape.nodes_on(l)},
                      {"gaussians", level.gaussians},
                      {"mean_error", level.mean_error},
                      {"max_error", level.max_error}});
  }
  const auto position = [&](const glm::vec3& p) { return json_location(p, header.origin); };
  return {
      {"name", path.stem().string()},
      {"format", "tree"},
      {"source", printable(header.source.data())},
      {"gaussians", header.gaussians},
      {"model", name_of(header.model)},
      {"sh_degree", header.sh_degree},
      {"read", header.read},
      {"dropped", header.dropped},
      {"bounds", {{"min", position(header.low)}, {"max", position(header.high)}}},
      {"origin", {header.origin.x, header.origin.y, header.origin.z}},
      {"bytes", bytes},
      {"bytes_per_gaussian", static_cast<double>(bytes) / static_cast<double>(header.gaussians)},
      {"pages", shape.pages()},
      {"page_bytes", shape.page_bytes()},
      {"missing_bytes", shape.file_bytes() - std::min(shape.file_bytes(), std::uint64_t{bytes})},
      {"levels", levels}};
}

void print_tree(const nlohmann::ordered_json& tree) {
  const auto line = [](std::string_view label, const std::string& value) {
    fmt::print("{:<16}{}\n", label, value);
  };
  const auto count = [&](const char* name) { return tree[name].get<std::uint64_t>(); };
  line("scene", tree["name"].get<std::string>());
  line("format", "tree of clusters, from " + tree["source"].get<std::string>());
  line("model", tree["model"].get<std::string>());
  line("Gaussians", fmt::format("{}, SH degree {}; {} of {} were dropped", count("gaussians"),
                                count("sh_degree"), count("dropped"), count("read")));
  line("file",
       fmt::format("{:.1f} MB, {:.1f} bytes per Gaussian", 1e-6 * tree["bytes"].get<double>(),
                   tree["bytes_per_gaussian"].get<double>()));
  line("pages",
       fmt::format("{} of {:.0f} KB", count("pages"), 1e-3 * tree["page_bytes"].get<double>()));
  if (count("missing_bytes") > 0)
    line("cut off",
         fmt::format("{} bytes are missing, and with them detail", count("missing_bytes")));
  fmt::print("{:>7} {:>10} {:>13} {:>12} {:>12}\n", "level", "nodes", "Gaussians", "mean error",
             "max error");
  for (const auto& level : tree["levels"])
    fmt::print("{:>7} {:>10} {:>13} {:>12.4g} {:>12.4g}\n", level["level"].get<int>(),
               level["nodes"].get<std::uint64_t>(), level["gaussians"].get<std::uint64_t>(),
               level["mean_error"].get<double>(), level["max_error"].get<double>());
}

}  // namespace catgs
