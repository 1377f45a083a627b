// catgs-render compare: the difference of two pictures, or of the pictures of two folders.
#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "render_core/base/error.h"
#include "render_core/base/printable.h"
#include "render_core/base/thread_pool.h"
#include "render_core/metrics/image_quality.h"
#include "render_core/tools/commands.h"
#include "render_core/tools/json_report.h"
#include "render_core/tools/picture.h"
#include "render_core/tools/picture_camera.h"

namespace catgs {
namespace {

struct CompareOptions {
  std::string a, b;
  bool json = false;
  std::optional<double> required_psnr_db;
  bool same_cameras = false;
};

/// The picture of a comparison whose cameras are the farthest apart, if any are.
class CameraCheck {
 public:
  void add(const std::string& name, const std::filesystem::path& a,
           const std::filesystem::path& b) {
    const auto camera = camera_of_picture(a), other = camera_of_picture(b);
    if (!camera || !other) return;
    const CameraDifference difference(*camera, *other);
    if (!difference.matters()) return;
    ++count_;
    if (!worst_ || difference.units > worst_->units) worst_.emplace(difference), name_ = name;
  }
  /// Says on stderr that a comparison does not tell what it seems to.
  void warn() const {
    if (!worst_) return;
    fmt::print(stderr,
               "note: {} pictures were drawn by other cameras than their partners: {} by {:.3g} "
               "units, {:.3g} degrees, {:.3g} px of focal length or centre. Draw both along one "
               "path: trace script SCENE --script orbit --out path.tum, then frames --trace "
               "path.tum\n",
               count_, printable(name_), worst_->units, worst_->degrees, worst_->pixels);
  }
  [[nodiscard]] bool differ() const { return worst_.has_value(); }
  [[nodiscard]] nlohmann::ordered_json json() const {
    if (!worst_) return nullptr;
    return {{"pictures", count_},
            {"worst", name_},
            {"units", worst_->units},
            {"degrees", worst_->degrees},
            {"focal_or_centre_px", worst_->pixels}};
  }

 private:
  std::size_t count_ = 0;
  std::string name_;
  std::optional<CameraDifference> worst_;
};

void print_json(const ImageQuality& quality, const CameraCheck& cameras) {
  // JSON has no infinity: null stands for the PSNR of identical pictures.
  const nlohmann::ordered_json json = {
      {"psnr_db", quality.psnr()},
      {"ssim", quality.ssim},
      {"ssim_luma", quality.ssim_luma},
      {"max_error", quality.max_error},
      {"worst_block_psnr_db", quality.worst_block_psnr()},
      {"block_0_1_percent_psnr_db", quality.block_0_1_percent_psnr()},
      {"cameras_differ", cameras.json()}};
  write_json("-", json);
}

void print_table(const ImageQuality& quality) {
  fmt::print("PSNR               {:8.2f} dB\n", quality.psnr());
  fmt::print("SSIM               {:8.5f}     (11x11 Gaussian window, mean of R, G, B)\n",
             quality.ssim);
  fmt::print("SSIM of luma       {:8.5f}\n", quality.ssim_luma);
  fmt::print("largest error      {:8.1f} / 255\n", 255.0 * quality.max_error);
  fmt::print("worst 16x16 block  {:8.2f} dB\n", quality.worst_block_psnr());
  fmt::print("0.1 % block        {:8.2f} dB\n", quality.block_0_1_percent_psnr());
}

ImageQuality compare_pair(const std::filesystem::path& a_path,
                          const std::filesystem::path& b_path) {
  const Image a = read_picture(a_path);
  const Image b = read_picture(b_path);
  if (a.size_px != b.size_px) {
    throw InputError(b_path.string(), "size",
                     fmt::format("{}x{} pixels, but {} has {}x{}", b.size_px.x, b.size_px.y,
                                 a_path.string(), a.size_px.x, a.size_px.y));
  }
  return compare_images(a, b);
}

/// Pictures of a folder by name, without extension: renderings are PNG, photographs often JPEG.
std::map<std::string, std::filesystem::path> pictures_in(const std::filesystem::path& folder) {
  std::map<std::string, std::filesystem::path> pictures;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (!is_picture(entry.path()) || !entry.is_regular_file()) continue;
    const auto [known, added] = pictures.emplace(entry.path().stem().string(), entry.path());
    if (!added)
      throw InputError(folder.string(), known->first, "names two pictures", "keep one of them");
  }
  if (pictures.empty())
    throw InputError(folder.string(), "", "holds no picture", "PNG or JPEG files");
  return pictures;
}

struct NamedQuality {
  std::string name;
  double psnr = 0.0, ssim = 0.0;
};

/// Each picture of `a` with that of the same name in `b`; then the means.
std::vector<NamedQuality> compare_folders(const CompareOptions& options, std::size_t& left_out,
                                          CameraCheck& cameras) {
  const auto ours = pictures_in(options.a), theirs = pictures_in(options.b);
  std::vector<NamedQuality> all;
  for (const auto& [name, path] : ours) {
    all.push_back({name});
    if (!theirs.contains(name))
      throw InputError(options.b, name, "is missing", fmt::format("{} has it", options.a));
    cameras.add(name, path, theirs.at(name));
  }
  left_out = theirs.size() - ours.size();
  ThreadPool pool;
  pool.parallel_for(all.size(), [&](std::size_t i) {
    const ImageQuality quality = compare_pair(ours.at(all[i].name), theirs.at(all[i].name));
    all[i].psnr = quality.psnr();
    all[i].ssim = quality.ssim;
  });
  NamedQuality mean{"mean"};
  for (const NamedQuality& one : all) {
    mean.psnr += one.psnr / static_cast<double>(all.size());
    mean.ssim += one.ssim / static_cast<double>(all.size());
  }
  all.push_back(mean);
  return all;
}

/// Returns the mean PSNR.
double report_folders(const CompareOptions& options, CameraCheck& cameras) {
  std::size_t left_out = 0;
  const std::vector<NamedQuality> all = compare_folders(options, left_out, cameras);
  cameras.warn();
  if (options.json) {
    nlohmann::ordered_json json;
    for (const NamedQuality& one : all) {
      nlohmann::ordered_json& position =
          &one == &all.back() ? json["mean"] : json["per_view"][one.name];
      position = {{"psnr_db", one.psnr}, {"ssim", one.ssim}};
    }
    json["left_out"] = left_out;
    json["cameras_differ"] = cameras.json();
    write_json("-", json);
    return all.back().psnr;
  }
  std::size_t width = 0;
  for (const NamedQuality& one : all) width = std::max(width, one.name.size());
  for (const NamedQuality& one : all)
    fmt::print("{:<{}}  {:8.2f} dB  SSIM {:8.5f}\n", printable(one.name), width, one.psnr,
               one.ssim);
  if (left_out > 0)
    fmt::print("{} pictures of {} have no partner in {}\n", left_out, printable(options.b),
               printable(options.a));
  return all.back().psnr;
}

/// Returns the PSNR.
double report_pair(const CompareOptions& options, CameraCheck& cameras) {
  const ImageQuality quality = compare_pair(options.a, options.b);
  cameras.add(options.a, options.a, options.b);
  cameras.warn();
  if (options.json) {
    print_json(quality, cameras);
  } else {
    print_table(quality);
  }
  return quality.psnr();
}

void compare(const CompareOptions& options) {
  std::error_code error;
  const bool folders = std::filesystem::is_directory(options.a, error);
  if (folders != std::filesystem::is_directory(options.b, error))
    throw InputError(options.b, "", "one is a folder and the other is not",
                     "two pictures or two folders");
  CameraCheck cameras;
  const double psnr = folders ? report_folders(options, cameras) : report_pair(options, cameras);
  if (options.same_cameras && cameras.differ())
    throw CheckFailed("pictures were drawn by different cameras, so their difference tells little");
  if (options.required_psnr_db && !(psnr >= *options.required_psnr_db)) {
    throw CheckFailed(fmt::format("PSNR is {:.2f} dB, below the required {:.2f} dB", psnr,
                                  *options.required_psnr_db));
  }
}

}  // namespace

void add_compare_command(CLI::App& app) {
  auto options = std::make_shared<CompareOptions>();
  CLI::App* command = app.add_subcommand(
      "compare",
      "Compares two pictures (PNG, JPEG), or those of two folders by name. Notes where frames has "
      "drawn them with different cameras");
  command->add_option("a", options->a, "Picture or folder")->required();
  command->add_option("b", options->b, "Picture or folder to compare with")->required();
  command->add_flag("--json", options->json, "Print JSON");
  command->add_option("--require-psnr", options->required_psnr_db,
                      "Exit with 1 if the PSNR, of folders its mean, is below this many dB");
  command->add_flag("--require-same-cameras", options->same_cameras,
                    "Exit with 1 if pictures of frames tell cameras that differ");
  command->callback([options] { compare(*options); });
}

}  // namespace catgs
