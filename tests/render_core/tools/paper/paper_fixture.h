#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "render_core/scene/files/save_scene.h"
#include "tests/render_core/tools/glide.h"
#include "tests/render_core/tools/run_catgs_render.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test_scenes.h"

namespace catgs::test {

/// `catgs-render paper` with two small scenes and a trace.
class Paper : public ::testing::Test {
 protected:
  void SetUp() override {
    save_scene(random_cloud(2000, 1, 7), folder_ / "cloud.ply");
    save_scene(random_cloud(500, 0, 8), folder_ / "mist.ply");
    write_tum(folder_ / "glide.tum", glide(40));
  }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  Outcome paper(const std::string& arguments) const {
    return run(fmt::format("--quiet paper --size 96x64 --near 0.2 --renderer cpu {}", arguments));
  }
  std::string cloud_case() const {
    return fmt::format("--case {} {}", path("cloud.ply"), path("glide.tum"));
  }
  std::string both_cases() const {
    return fmt::format("{} --case {} {}", cloud_case(), path("mist.ply"), path("glide.tum"));
  }

  /// The tables as JSON; both scenes.
  nlohmann::ordered_json tables(const std::string& name, const std::string& more = {}) const {
    const Outcome outcome =
        paper(fmt::format("--table {} {} {} --json -", name, both_cases(), more));
    EXPECT_EQ(outcome.exit_code, 0) << outcome.out;
    return nlohmann::ordered_json::parse(outcome.out).at("tables").at(name);
  }

  static std::vector<std::string> names(const nlohmann::ordered_json& object) {
    std::vector<std::string> names;
    for (const auto& [name, value] : object.items()) names.push_back(name);
    return names;
  }

  const TemporaryFolder folder_;
};

}  // namespace catgs::test
