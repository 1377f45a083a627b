// catgs-render formats: what each format that we write costs in bytes, time and memory, and what it
// loses.
#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <glm/geometric.hpp>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "render_core/base/error.h"
#include "render_core/scene/clusters.h"
#include "render_core/scene/copy_gaussians.h"
#include "render_core/scene/files/load_scene.h"
#include "render_core/scene/files/save_scene.h"
#include "render_core/scene/keep_if.h"
#include "render_core/tools/commands.h"
#include "render_core/tools/json_report.h"
#include "render_core/tools/scene_options.h"
#include "render_core/tools/table.h"

namespace catgs {
namespace {

using Json = nlohmann::ordered_json;

struct FormatsOptions {
  SceneOptions scene;
  int threads = 0;
  std::string json;
};

constexpr std::array extensions = {".ply", ".glb", ".spz", ".splat", ".sog"};
constexpr float min_opacity = 1.5f / 255;  // less may be rounded to what is never drawn
constexpr std::array attributes = {"Position", "Log scale",   "Rotation, rad",
                                   "Opacity",  "Constant SH", "SH above"};

class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = std::filesystem::temp_directory_path() / "catgs_formats_XXXXXX";
    if (::mkdtemp(name.data()) == nullptr)
      throw std::system_error(errno, std::generic_category(), name);
    path_ = name;
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

rusage usage() {
  rusage now{};
  ::getrusage(RUSAGE_SELF, &now);
  return now;
}

double processor_seconds(const rusage& usage) {
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

/// Runs `step`; its seconds, processor-seconds, and the memory that it took beyond what the process
/// held before. The process must be new, because its peak is that of its whole life.
Json cost_of(const std::function<void()>& step) {
  const rusage before = usage();
  const auto start = std::chrono::steady_clock::now();
  step();
  const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - start;
  const rusage after = usage();
  constexpr double mb_per_kib = 1024e-6;
  return {{"seconds", wall.count()},
          {"processor_seconds", processor_seconds(after) - processor_seconds(before)},
          {"peak_mb", mb_per_kib * static_cast<double>(after.ru_maxrss - before.ru_maxrss)}};
}

/// What `work` returns, run in a process of its own. No other thread may be running here.
Json in_child(const std::function<Json()>& work) {
  std::array<int, 2> ends{};
  if (::pipe(ends.data()) != 0) throw std::system_error(errno, std::generic_category(), "pipe");
  std::fflush(nullptr);
  const pid_t child = ::fork();
  if (child < 0) throw std::system_error(errno, std::generic_category(), "fork");
  if (child == 0) {
    Json answer;
    try {
      answer = work();
    } catch (const std::exception& error) {
      answer = {{"error", error.what()}};
    }
    FILE* to = ::fdopen(ends[1], "w");
    fmt::print(to, "{}", answer.dump(-1, ' ', false, Json::error_handler_t::replace));
    std::fclose(to);
    ::_exit(0);
  }
  ::close(ends[1]);
  std::string text;
  std::array<char, 4096> part{};
  for (ssize_t got = 0; (got = ::read(ends[0], part.data(), part.size())) > 0;)
    text.append(part.data(), static_cast<std::size_t>(got));
  ::close(ends[0]);
  int status = 0;
  ::waitpid(child, &status, 0);
  const Json answer = Json::parse(text, nullptr, false);
  if (answer.is_discarded())
    throw std::runtime_error("a process was ended; perhaps there was no memory left for it");
  if (answer.contains("error")) throw std::runtime_error(answer["error"].get<std::string>());
  return answer;
}

/// Mean and largest error of the attributes, in their order.
class Errors {
 public:
  void add(std::size_t attribute, double error) {
    sum_[attribute] += std::abs(error);
    max_[attribute] = std::max(max_[attribute], std::abs(error));
    ++count_[attribute];
  }
  [[nodiscard]] Json json() const {
    Json means = Json::array(), largest = Json::array();
    for (std::size_t i = 0; i < attributes.size(); ++i) {
      means.push_back(count_[i] > 0 ? Json(sum_[i] / static_cast<double>(count_[i])) : Json());
      largest.push_back(count_[i] > 0 ? Json(max_[i]) : Json());
    }
    return {{"mean", means}, {"max", largest}};
  }

 private:
  std::array<double, attributes.size()> sum_{}, max_{};
  std::array<std::size_t, attributes.size()> count_{};
};

/// Angle between two orientations, whatever the signs of the quaternions.
double angle_between(const glm::quat& a, const glm::quat& b) {
  const glm::quat turn = glm::conjugate(a) * b;
  return 2.0 * std::atan2(glm::length(glm::vec3(turn.x, turn.y, turn.z)), std::abs(turn.w));
}

/// The clouds have the same Gaussians in the same order. Harmonics that the file leaves out have no
/// error.
Json errors_of(const GaussianCloud& wanted, const GaussianCloud& read) {
  if (read.size() != wanted.size())
    throw std::runtime_error(
        fmt::format("{} of {} Gaussians were read again", read.size(), wanted.size()));
  Errors errors;
  const int sh_count = std::min(wanted.sh_count(), read.sh_count());
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    errors.add(0, glm::distance(wanted.mean[i], read.mean[i]));
    for (int k = 0; k < 3; ++k) errors.add(1, std::log(wanted.scale[i][k] / read.scale[i][k]));
    errors.add(2, angle_between(wanted.rotation[i], read.rotation[i]));
    errors.add(3, wanted.opacity[i] - read.opacity[i]);
    for (int c = 0; c < sh_count; ++c)
      for (int k = 0; k < 3; ++k)
        errors.add(c == 0 ? 4 : 5, wanted.sh_of(i)[c][k] - read.sh_of(i)[c][k]);
  }
  return errors.json();
}

/// Writes the cloud and reads it again, each in a process of its own.
Json try_format(const GaussianCloud& cloud, const std::filesystem::path& path, int threads) {
  Json trial;
  trial["write"] = in_child([&] { return cost_of([&] { save_scene(cloud, path, threads); }); });
  trial["mb"] = 1e-6 * static_cast<double>(std::filesystem::file_size(path));
  Json read = in_child([&] {
    Scene scene;
    LoadOptions options;
    options.threads = threads;
    options.first_view = false;
    Json cost = cost_of([&] { scene = load_scene(path, options); });
    cost["errors"] = errors_of(cloud, scene.cloud);
    return cost;
  });
  trial["errors"] = std::move(read["errors"]);
  read.erase("errors");
  trial["read"] = std::move(read);
  std::filesystem::remove(path);
  return trial;
}

/// In the order in which .sog stores Gaussians, so that every file keeps it.
GaussianCloud measured_cloud(GaussianCloud cloud, int threads) {
  keep_if(cloud, [&](std::size_t i) { return cloud.opacity[i] >= min_opacity; });
  ThreadPool pool(threads);
  return reordered(cloud, morton_order(cloud.mean, pool));
}

PaperTable cost_table(const std::string& title, const GaussianCloud& cloud, const Json& trials) {
  PaperTable table{.title = title,
                   .corner = "Format",
                   .columns = {"MB", "Bytes each", "Write MB/s", "Write s per M", "Write peak",
                               "Read MB/s", "Read s per M", "Read peak"},
                   .rows = {},
                   .notes = {"MB/s: of the file. s per M: processor-seconds per million Gaussians. "
                             "Peak: memory beyond what was held before, which is the scene when "
                             "writing and nothing of it when reading."}};
  const double millions = 1e-6 * static_cast<double>(cloud.size());
  for (const auto& [name, trial] : trials.items()) {
    const double mb = trial["mb"];
    PaperTable::Row row{name, {{mb, 1}, {mb / millions, 1}}};
    for (const char* step : {"write", "read"}) {
      const Json& cost = trial[step];
      row.numbers.push_back({mb / cost["seconds"].get<double>(), 0});
      row.numbers.push_back({cost["processor_seconds"].get<double>() / millions, 2});
      row.numbers.push_back({cost["peak_mb"], 0, " MB"});
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

PaperTable error_table(const Json& trials, const char* kind, const char* title) {
  PaperTable table{.title = title,
                   .corner = "Format",
                   .columns = {attributes.begin(), attributes.end()},
                   .rows = {},
                   .notes = {}};
  for (const auto& [name, trial] : trials.items()) {
    PaperTable::Row row{name, {}};
    for (const Json& error : trial["errors"][kind])
      row.numbers.push_back({error.is_null() ? Number::nothing : error.get<double>(), 5});
    table.rows.push_back(std::move(row));
  }
  return table;
}

void formats(const FormatsOptions& options, bool quiet) {
  if (options.json != "-") check_json(options.json);
  Scene scene = load_scene(options.scene, options.threads, quiet, false);
  const std::size_t loaded = scene.cloud.size();
  const GaussianCloud cloud = measured_cloud(std::exchange(scene.cloud, {}), options.threads);
  if (cloud.empty()) throw InputError(options.scene.path, "", "all its Gaussians are too faint");
  const TemporaryFolder folder;
  Json trials;
  for (const char* extension : extensions)
    trials[extension] =
        try_format(cloud, folder.path() / (std::string("scene") + extension), options.threads);
  if (!options.json.empty())
    write_json(options.json, {{"scene", scene.name},
                              {"gaussians", cloud.size()},
                              {"sh_degree", cloud.sh_degree},
                              {"attributes", attributes},
                              {"formats", trials}});
  if (options.json == "-") return;
  const std::string title =
      fmt::format("{}, {} Gaussians, SH degree {}", scene.name, cloud.size(), cloud.sh_degree);
  PaperTable mean = error_table(trials, "mean", "Mean error");
  mean.notes = {
      fmt::format("{} of {} Gaussians were fainter than 1.5/255 and left out. Positions "
                  "are in world units.",
                  loaded - cloud.size(), loaded)};
  fmt::print("{}\n{}\n{}", markdown(cost_table(title, cloud, trials)),
             markdown(error_table(trials, "max", "Largest error")), markdown(mean));
}

}  // namespace

void add_formats_command(CLI::App& app) {
  auto options = std::make_shared<FormatsOptions>();
  CLI::App* command = app.add_subcommand(
      "formats", "Writes a scene in each format and reads it again: size, speed, memory, errors");
  add_scene_options(*command, options->scene);
  command->add_option("--threads", options->threads, "0: one per processor")->capture_default_str();
  command->add_option("--json", options->json, "Also write a report to this file; - prints it");
  command->callback([options, command] { formats(*options, is_quiet(*command)); });
}

}  // namespace catgs
