#include <cmath>
#include <sstream>

#include "render_core/motion/trajectory.h"
#include "server/config.h"
#include "tests/fuzz/target.h"

namespace catgs::fuzz {
namespace {

void parse_tum(Bytes input) {
  const Trajectory poses = read_tum(FileInMemory(input).path());
  require(!poses.empty(), "a trajectory holds a pose");
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Pose& pose = poses[i].world_from_camera;
    require(i == 0 || poses[i - 1].time_us < poses[i].time_us, "times increase");
    require(std::isfinite(glm::length(pose.position)), "positions are finite");
    require(std::abs(glm::length(pose.orientation) - 1.0f) < 1e-3f, "orientations have length 1");
  }
}

std::map<std::string, std::string> tum_seeds() {
  return {{"three",
           "# timestamp tx ty tz qx qy qz qw\n0 0 0 0 0 0 0 1\n0.5 1 2 3 0 0 0.7071 0.7071\n"
           "\n1.25\t-1e-3 2 3.5 0.5 0.5 0.5 0.5\r\n"}};
}

ServerConfig read_toml(const std::string& text) {
  ServerConfig config;
  ConfigSources sources;
  apply_toml(FileInMemory(bytes_of(text)).path(), config, sources);
  return config;
}

void parse_config(Bytes input) {
  const std::string printed = print_config(read_toml(text_of(input)), {});
  require(print_config(read_toml(printed), {}) == printed, "--print-config is a file of settings");
}

std::map<std::string, std::string> config_seeds() {
  std::string all;
  std::istringstream lines(print_config({}, {}));
  for (std::string line; std::getline(lines, line);)
    if (line.find("= []") == std::string::npos) all += line + "\n";
  return {{"defaults", all},
          {"museum",
           "scene = [\"a.ply\", 'b c.spz']\nport = 9000 # comment\nopen = true\n"
           "allow-origin = [\n  \"https://a.example\",\n]\nlog-format = \"json\"\n"}};
}

std::vector<std::string> setting_names() {
  std::vector<std::string> words = {
      "\"\"\"",   "'''", "\\u0000", "\\n", "[[", "true", "inf", "0x1F", "1979-05-27T07:32:00Z",
      "{ a = 1 }"};
  for (const Setting& setting : settings()) words.push_back(setting.name + " = ");
  return words;
}

}  // namespace

Target tum() {
  return {.name = "tum",
          .parse = parse_tum,
          .seeds = tum_seeds,
          .dictionary = {"nan", "inf", "1e308", "1e-320", "9e9", "-0", " 0 0 0 1\n", "#"},
          .max_bytes = 1024};
}

Target config() {
  return {.name = "config",
          .parse = parse_config,
          .seeds = config_seeds,
          .dictionary = setting_names(),
          .max_bytes = 2048};
}

}  // namespace catgs::fuzz
