// catgs-render paper against photographs.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/render_core/tools/paper/paper_fixture.h"

namespace catgs {
namespace {

using test::Outcome;
using test::run;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using Json = nlohmann::ordered_json;

/// Photographs of the cloud made by the exact pipeline, with a COLMAP reconstruction of their
/// cameras.
class PaperPhotographs : public test::Paper {
 protected:
  static constexpr std::size_t photos = 6;

  void SetUp() override {
    Paper::SetUp();
    std::filesystem::create_directories(folder_ / "photos/images");
    std::filesystem::create_directories(folder_ / "photos/sparse/0");
    const Outcome outcome =
        run(fmt::format("--quiet frames {} --size 96x64 --focal-px 80 --near 0.2 --renderer cpu "
                        "--trace {} --frames :{} --out {}",
                        path("cloud.ply"), path("glide.tum"), photos, path("photos/images")));
    ASSERT_EQ(outcome.exit_code, 0) << outcome.out;
    std::ofstream(path("photos/sparse/0/cameras.txt"))
        << "# cameras\n7 PINHOLE 96 64 80 80 48 32\n";
    std::ofstream images(path("photos/sparse/0/images.txt"));
    for (std::size_t i = photos; i-- > 0;) {  // in any order
      images << fmt::format("{} 1 0 0 0 {} 0 0 7 frame_{:06}.jpg\n\n", i + 1,
                            -0.004 * static_cast<double>(i), i);
    }
  }

  std::string arguments() const {
    return fmt::format("--table quality --case {} --images {} --image-rate 30 --llffhold 1",
                       path("cloud.ply"), path("photos"));
  }
};

TEST_F(PaperPhotographs, AreMetByKeyFramesAndSubFrames) {
  const Outcome outcome = paper(arguments() + " --json -");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.out;
  const Json report = Json::parse(outcome.out);
  const Json table = report.at("tables").at("quality").at(0);
  EXPECT_THAT(names(table.at("rows")),
              ElementsAre("3DGS", "Exact", "Ours", "Paper-key", "Paper-sub"));
  // Bound by the 8 bits of the photographs: uniform rounding is 58.9 dB.
  for (const char* row : {"Exact", "Ours", "Paper-key", "Paper-sub"}) {
    EXPECT_GE(table.at("rows").at(row).at("cloud PSNR").get<double>(), 50.0) << row;
    EXPECT_LE(table.at("rows").at(row).at("cloud PSNR").get<double>(), 65.0) << row;
  }
  EXPECT_THAT(table.at("notes").at(0).get<std::string>(),
              HasSubstr("against 6 of 6 photographs (llffhold 1) of 96x64 px"));
  const Json& scene = report.at("cases").at(0);
  EXPECT_THAT(names(scene.at("per_view")),
              ElementsAre("3DGS", "Exact", "Ours", "Paper-key", "Paper-sub"));
  const Json& views = scene.at("per_view").at("Exact").at("PSNR");
  ASSERT_EQ(views.size(), photos);
  double worst = 1e3;
  for (const Json& view : views) worst = std::min(worst, view.get<double>());
  EXPECT_EQ(worst, table.at("rows").at("Exact").at("cloud worst PSNR").get<double>());
  EXPECT_GT(scene.at("per_view").at("Exact").at("SSIM").at("frame_000003.jpg").get<double>(), 0.99);
}

TEST_F(PaperPhotographs, TheFooterStatesTheSizeThatWasCompared) {
  const Outcome outcome = run("--quiet paper --size 1280x720 --renderer cpu " + arguments());
  ASSERT_EQ(outcome.exit_code, 0) << outcome.out;
  EXPECT_THAT(outcome.out, HasSubstr("\nphotographs at 96x64 px, focal lengths of COLMAP, "));
  EXPECT_THAT(outcome.out, Not(HasSubstr("1280")));
  const Json settings = Json::parse(paper(arguments() + " --json -").out).at("settings");
  EXPECT_TRUE(settings.at("size_px").is_null());
}

TEST_F(PaperPhotographs, EveryEighthIsATestView) {
  for (std::size_t i = photos; i < 10; ++i) {
    std::filesystem::copy_file(path("photos/images/frame_000000.png"),
                               path(fmt::format("photos/images/frame_{:06}.png", i)));
    std::ofstream(path("photos/sparse/0/images.txt"), std::ios::app)
        << fmt::format("{} 1 0 0 0 0 0 0 7 frame_{:06}.jpg\n\n", i + 1, i);
  }
  const std::string quality = fmt::format("--table quality --case {} --images {} --json - ",
                                          path("cloud.ply"), path("photos"));
  const Outcome outcome = paper(quality);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.out;
  const Json scene = Json::parse(outcome.out).at("cases").at(0);
  EXPECT_THAT(names(scene.at("photographs_px")),
              ElementsAre("frame_000000.jpg", "frame_000008.jpg"));
  const Outcome every = paper(quality + "--every 1");
  EXPECT_EQ(every.exit_code, 2);
  EXPECT_THAT(every.out, HasSubstr("--every: has no effect"));
}

TEST_F(PaperPhotographs, MayBeJpegOfAnySize) {
  std::filesystem::create_directory(path("photos/images_2"));
  for (std::size_t i = 0; i < photos; ++i) {
    std::filesystem::copy_file(CATGS_TOOLS_DATA "/photo.jpg",
                               path(fmt::format("photos/images_2/frame_{:06}.jpg", i)));
  }
  const Outcome outcome = paper(arguments() + " --image-folder images_2");
  if (outcome.out.find("without libav") != std::string::npos) GTEST_SKIP() << outcome.out;
  ASSERT_EQ(outcome.exit_code, 0) << outcome.out;
  EXPECT_THAT(outcome.out, HasSubstr("photographs at 48x32 px"));
}

TEST_F(PaperPhotographs, HaveToBeThere) {
  std::filesystem::remove(folder_ / "photos/images/frame_000003.png");
  const Outcome outcome = paper(arguments());
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.out,
              HasSubstr("frame_000003.jpg: does not exist (photographs are PNG or JPEG"));
}

}  // namespace
}  // namespace catgs
