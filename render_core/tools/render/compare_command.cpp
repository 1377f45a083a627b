// catgs-render compare: the difference of two pictures.
#include <cmath>
#include <memory>
#include <optional>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "render_core/base/error.h"
#include "render_core/image/png.h"
#include "render_core/metrics/image_quality.h"
#include "render_core/tools/commands.h"
#include "render_core/tools/json_report.h"

namespace catgs {
namespace {

struct CompareOptions {
  std::string a, b;
  bool json = false;
  std::optional<double> required_psnr_db;
};

void print_json(const ImageQuality& quality) {
  // JSON has no infinity: null stands for the PSNR of identical pictures.
  const nlohmann::ordered_json json = {
      {"psnr_db", quality.psnr()},
      {"ssim", quality.ssim},
      {"max_error", quality.max_error},
      {"worst_block_psnr_db", quality.worst_block_psnr()},
      {"block_0_1_percent_psnr_db", quality.block_0_1_percent_psnr()}};
  write_json("-", json);
}

void print_table(const ImageQuality& quality) {
  fmt::print("PSNR               {:8.2f} dB\n", quality.psnr());
  fmt::print("SSIM               {:8.5f}     (11x11 Gaussian window, mean of R, G, B)\n",
             quality.ssim);
  fmt::print("largest error      {:8.1f} / 255\n", 255.0 * quality.max_error);
  fmt::print("worst 16x16 block  {:8.2f} dB\n", quality.worst_block_psnr());
  fmt::print("0.1 % block        {:8.2f} dB\n", quality.block_0_1_percent_psnr());
}

void compare(const CompareOptions& options) {
  const Image a = read_png(options.a);
  const Image b = read_png(options.b);
  if (a.size_px != b.size_px) {
    throw InputError(options.b, "size",
                     fmt::format("{}x{} pixels, but {} has {}x{}", b.size_px.x, b.size_px.y,
                                 options.a, a.size_px.x, a.size_px.y));
  }
  const ImageQuality quality = compare_images(a, b);
  if (options.json) {
    print_json(quality);
  } else {
    print_table(quality);
  }
  if (options.required_psnr_db && !(quality.psnr() >= *options.required_psnr_db)) {
    throw CheckFailed(fmt::format("PSNR is {:.2f} dB, below the required {:.2f} dB", quality.psnr(),
                                  *options.required_psnr_db));
  }
}

}  // namespace

void add_compare_command(CLI::App& app) {
  auto options = std::make_shared<CompareOptions>();
  CLI::App* command = app.add_subcommand("compare", "Compares two PNG pictures of one size");
  command->add_option("a", options->a, "First picture")->required();
  command->add_option("b", options->b, "Second picture")->required();
  command->add_flag("--json", options->json, "Print JSON");
  command->add_option("--require-psnr", options->required_psnr_db,
                      "Exit with 1 if the PSNR is below this many dB");
  command->callback([options] { compare(*options); });
}

}  // namespace catgs
