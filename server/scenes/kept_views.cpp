#include "server/scenes/kept_views.h"

#include <array>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <string_view>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "render_core/base/error.h"

namespace catgs {
namespace {

constexpr std::size_t most_view_bytes = 4096;
constexpr std::string_view first_line = "catgs view 3\n";  // of a kept view

/// The numbers of an estimate, in the order in which they are kept. They are about its origin.
std::array<float*, 21> numbers_of(SceneHints& hints) {
  auto& [min, max] = hints.limits;
  auto& [position, turn] = hints.start_pose;
  return {&hints.up.x,    &hints.up.y,    &hints.up.z, &position.x, &position.y,   &position.z,
          &turn.x,        &turn.y,        &turn.z,     &turn.w,     &hints.near_z, &min.x,
          &min.y,         &min.z,         &max.x,      &max.y,      &max.z,        &hints.focus.x,
          &hints.focus.y, &hints.focus.z, &hints.scale};
}

std::string written(SceneHints hints) {
  std::string text(first_line);
  for (int axis = 0; axis < 3; ++axis) text += fmt::format("{}\n", hints.origin[axis]);
  for (const float* number : numbers_of(hints)) text += fmt::format("{}\n", *number);
  return text + fmt::format("{:d}\n", hints.up_is_doubtful);
}

SceneHints read_view(std::string_view text, const std::string& name) {
  SceneHints hints;
  hints.source = "estimated";
  bool good = text.starts_with(first_line);
  text.remove_prefix(good ? first_line.size() : 0);
  const auto take = [&](auto& number) {
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    good = good && error == std::errc() && end != text.data() + text.size() && *end == '\n' &&
           std::isfinite(number);
    if (!good) throw InputError(name, {}, "is no kept view");
    text.remove_prefix(static_cast<std::size_t>(end - text.data()) + 1);
  };
  for (int axis = 0; axis < 3; ++axis) take(hints.origin[axis]);
  for (float* number : numbers_of(hints)) take(*number);
  int doubtful = 0;
  take(doubtful);
  hints.up_is_doubtful = doubtful != 0;
  return hints;
}

std::string text_of(const std::optional<Sidecar>& sidecar) {
  if (!sidecar || !sidecar->up) return {};
  const glm::vec3& up = *sidecar->up;
  return fmt::format("{} {} {}", up.x, up.y, up.z);
}

}  // namespace

std::string camera_facts(const HintFiles& hints) {
  std::string facts;
  for (const auto& file : {hints.cameras, hints.transforms, hints.test_views}) {
    std::error_code none;
    const auto written_at = std::filesystem::last_write_time(file, none);
    facts += fmt::format("\n{}", none ? 0 : written_at.time_since_epoch().count());
  }
  return facts;
}

KeepView keep_view(const DerivedFiles* files, const SceneLocation& scene,
                   const ServerConfig& config) {
  if (!files || scene.format == nullptr) return {};
  const std::string name =
      derived_name(scene,
                   fmt::format("{}\n{}\n{}{}", content_facts(scene), config.up,
                               text_of(sidecar_at(scene.hints)), camera_facts(scene.hints)),
                   ".view");
  return [files, name](const std::function<SceneHints()>& estimate) {
    const auto check = [&](const ByteSource& file) {
      const auto bytes = file.read_all(most_view_bytes);
      (void)read_view({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, file.name());
    };
    if (const auto text = files->read(name, most_view_bytes, check)) return read_view(*text, name);
    SceneHints hints = estimate();
    files->write(name, written(hints), DerivedFiles::most_views);
    return hints;
  };
}

}  // namespace catgs
