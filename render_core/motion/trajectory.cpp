#include "render_core/motion/trajectory.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <stdexcept>
#include <string>
#include <string_view>

#include <fmt/format.h>

#include "render_core/base/error.h"

namespace catgs {
namespace {

constexpr std::size_t max_line_bytes = 1024;
constexpr std::size_t max_poses = 10'000'000;  // a day at 115 Hz
constexpr double max_time_s = 9e9;             // microseconds stay exact in a double
constexpr double norm_tolerance = 0.1;         // files carry three digits or more
constexpr std::string_view tum_format = "timestamp_s tx ty tz qx qy qz qw";

/// Splits off the next word of `rest`; empty at the end.
std::string_view next_word(std::string_view& rest) {
  const std::size_t begin = std::min(rest.find_first_not_of(" \t\r"), rest.size());
  const std::size_t end = std::min(rest.find_first_of(" \t\r", begin), rest.size());
  const std::string_view word = rest.substr(begin, end - begin);
  rest.remove_prefix(end);
  return word;
}

class LineParser {
 public:
  LineParser(std::string source, std::size_t line_number, const glm::dvec3& origin)
      : source_(std::move(source)), where_(fmt::format("line {}", line_number)), origin_(origin) {}

  /// False for a blank line or a comment.
  bool parse(std::string_view line, TimedPose& pose) const {
    std::array<double, 8> value{};
    std::size_t count = 0;
    for (std::string_view word = next_word(line); !word.empty() && word.front() != '#';
         word = next_word(line)) {
      if (count == value.size()) fail("more than 8 numbers");
      const char* end = word.data() + word.size();
      const auto [stop, error] = std::from_chars(word.data(), end, value[count]);
      if (error != std::errc() || stop != end || !std::isfinite(value[count])) {
        fail(fmt::format("\"{}\" is not a number", word));
      }
      ++count;
    }
    if (count == 0) return false;
    if (count < value.size()) fail(fmt::format("{} numbers instead of 8", count));
    if (std::abs(value[0]) > max_time_s) fail("the time stamp is out of range");
    pose.time_us = std::llround(value[0] * 1e6);
    for (std::size_t axis = 1; axis <= 3; ++axis)
      if (std::abs(value[axis]) > max_coordinate) fail("the position is out of range");
    pose.world_from_camera.position = glm::vec3(glm::dvec3(value[1], value[2], value[3]) - origin_);
    const glm::dquat rotation(value[7], value[4], value[5], value[6]);
    const double norm = glm::length(rotation);
    if (!(std::abs(norm - 1.0) <= norm_tolerance)) {
      fail(fmt::format("the quaternion has norm {:.3g} instead of 1", norm));
    }
    pose.world_from_camera.orientation = glm::quat(rotation / norm);
    return true;
  }

  [[noreturn]] void fail(std::string_view what) const {
    throw InputError(source_, where_, what, fmt::format("a TUM line is \"{}\"", tum_format));
  }

 private:
  std::string source_;
  std::string where_;
  glm::dvec3 origin_;
};

}  // namespace

Trajectory read_tum(const std::filesystem::path& path, const glm::dvec3& origin) {
  std::ifstream file(path);
  if (!file) throw InputError(path.string(), "", "cannot be opened", "is it a readable file?");
  Trajectory trajectory;
  std::array<char, max_line_bytes> line{};
  for (std::size_t number = 1; file.peek() != std::ifstream::traits_type::eof(); ++number) {
    file.getline(line.data(), line.size());
    const LineParser parser(path.string(), number, origin);
    if (file.fail()) parser.fail(fmt::format("longer than {} bytes", max_line_bytes - 1));
    TimedPose pose;
    if (!parser.parse(line.data(), pose)) continue;
    if (!trajectory.empty() && pose.time_us <= trajectory.back().time_us) {
      parser.fail("the time stamp does not increase");
    }
    if (trajectory.size() == max_poses) parser.fail(fmt::format("more than {} poses", max_poses));
    trajectory.push_back(pose);
  }
  if (file.bad() || trajectory.empty()) {
    throw InputError(path.string(), "", file.bad() ? "cannot be read" : "holds no pose",
                     fmt::format("a TUM line is \"{}\"", tum_format));
  }
  return trajectory;
}

void write_tum(const std::filesystem::path& path, const Trajectory& trajectory,
               const glm::dvec3& origin) {
  std::string text = fmt::format("# {}\n", tum_format);
  for (const TimedPose& pose : trajectory) {
    const glm::vec3& p = pose.world_from_camera.position;
    const glm::quat& q = pose.world_from_camera.orientation;
    const glm::dvec3 in_file = glm::dvec3(p) + origin;
    // fmt prints the shortest decimals that read back as the same number.
    const std::string point = origin == glm::dvec3(0.0)
                                  ? fmt::format("{} {} {}", p.x, p.y, p.z)
                                  : fmt::format("{} {} {}", in_file.x, in_file.y, in_file.z);
    fmt::format_to(std::back_inserter(text), "{:.6f} {} {} {} {} {}\n",
                   static_cast<double>(pose.time_us) * 1e-6, point, q.x, q.y, q.z, q.w);
  }
  std::ofstream file(path, std::ios::binary);
  file << text << std::flush;
  if (!file)
    throw InputError(path.string(), "", "cannot be written", "is there room, and a right?");
}

Pose interpolate(const Trajectory& trajectory, std::int64_t time_us) {
  if (trajectory.empty()) throw std::invalid_argument("interpolate: the trajectory is empty");
  const auto after = std::upper_bound(
      trajectory.begin(), trajectory.end(), time_us,
      [](std::int64_t time, const TimedPose& pose) { return time < pose.time_us; });
  if (after == trajectory.begin()) return after->world_from_camera;
  const TimedPose& from = *std::prev(after);
  if (after == trajectory.end()) return from.world_from_camera;
  const auto fraction = static_cast<float>(static_cast<double>(time_us - from.time_us) /
                                           static_cast<double>(after->time_us - from.time_us));
  const Pose& a = from.world_from_camera;
  const Pose& b = after->world_from_camera;
  return {glm::mix(a.position, b.position, fraction),
          glm::normalize(glm::slerp(a.orientation, b.orientation, fraction))};
}

Trajectory resample(const Trajectory& trajectory, double rate_hz) {
  if (trajectory.empty()) return {};
  const std::int64_t first_us = trajectory.front().time_us;
  const auto span_us = static_cast<double>(trajectory.back().time_us - first_us);
  const double count = std::floor(span_us * 1e-6 * rate_hz) + 1.0;
  if (!(rate_hz > 0.0 && count <= static_cast<double>(max_poses))) {
    throw InputError("--fps", "", fmt::format("{} Hz gives no or too many poses", rate_hz),
                     fmt::format("at most {} poses", max_poses));
  }
  Trajectory resampled(static_cast<std::size_t>(count));
  for (std::size_t i = 0; i < resampled.size(); ++i) {
    const std::int64_t time_us = first_us + std::llround(static_cast<double>(i) / rate_hz * 1e6);
    resampled[i] = {time_us, interpolate(trajectory, time_us)};
  }
  return resampled;
}

}  // namespace catgs
