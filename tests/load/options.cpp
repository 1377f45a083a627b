#include "tests/load/options.h"

#include <charconv>
#include <map>
#include <string_view>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "render_core/base/error.h"
#include "tests/load/units.h"

namespace catgs::load {
namespace {

/// "1.26x1.12"
glm::dvec2 parse_overscan(const std::string& text) {
  glm::dvec2 sides(0.0);
  const std::size_t by = std::min(text.find('x'), text.size());
  const std::string_view parts[] = {std::string_view(text).substr(0, by),
                                    std::string_view(text).substr(std::min(by + 1, text.size()))};
  for (int i = 0; i < 2; ++i) {
    const char* end = parts[i].data() + parts[i].size();
    const auto [stop, error] = std::from_chars(parts[i].data(), end, sides[i]);
    if (error != std::errc() || stop != end || !(sides[i] >= 1.0 && sides[i] <= 2.0)) {
      throw InputError("--overscan", "", fmt::format("\"{}\" is not two factors of 1 to 2", text),
                       "like 1.26x1.12");
    }
  }
  return sides;
}

/// Returns the option of the whole.
CLI::Option* add_display_options(CLI::App& app, DisplayOptions& display) {
  const std::map<std::string, WarpMode> warps = {{"auto", WarpMode::automatic},
                                                 {"turn", WarpMode::turn},
                                                 {"plane", WarpMode::plane},
                                                 {"off", WarpMode::off}};
  auto* glass = app.add_flag("--glass", display.judged,
                             "Show frames as the page does, and judge what is shown by the exact "
                             "picture of the visitor's pose; needs --check-scene");
  app.add_option("--display-hz", display.hz, "Refreshes, and poses: 60 or 120 as a rule")
      ->check(CLI::Range(24, 240))
      ->capture_default_str()
      ->needs(glass);
  app.add_option("--warp", display.warp,
                 "Of the newest picture to the newest pose: turn, plane (at the scene's focus), "
                 "off, or auto: as the page does for the script")
      ->transform(CLI::Transformer(warps))
      ->needs(glass);
  app.add_option_function<std::string>(
         "--overscan",
         [&display](const std::string& text) { display.overscan = parse_overscan(text); },
         "Sides of pictures over those of the view, such as 1.26x1.12 (default: by the motion, as "
         "the page)")
      ->needs(glass);
  return glass;
}

}  // namespace

CLI::Option* add_duration(CLI::App& app, const std::string& flag, double& seconds,
                          const std::string& help) {
  return app.add_option_function<std::string>(
      flag, [&seconds, flag](const std::string& text) { seconds = parse_duration_s(flag, text); },
      help);
}

void add_client_options(CLI::App& app, GroupOptions& group) {
  Wishes& wishes = group.wishes;
  Manners& manners = group.manners;
  app.add_option("--sessions", group.sessions, "Clients at the same time")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  add_duration(app, "--ramp", group.ramp_s, "Spread the starts over this time")->default_str("0s");
  auto* trace =
      app.add_option("--trace,--traces", group.traces,
                     "Camera paths, replayed at their own times, forth and back; sessions "
                     "take turns and begin at different places");
  app.add_flag("--anchor", group.anchor, "Move traces to the scene's start pose")->needs(trace);
  app.add_option("--script", group.script.script, "orbit, walk, head, drone, still or tour:FILE")
      ->excludes(trace);
  app.add_option("--seed", group.script.seed, "Of the script; each session adds its number")
      ->capture_default_str();
  app.add_option("--scene", wishes.scene, "Scene id (default: the server's first)");
  app.add_option("--size,--sizes", group.sizes, "Wanted frame sizes, pixels; sessions take turns")
      ->capture_default_str();
  app.add_option("--moving-size", group.moving_size,
                 "Wanted while the camera moves; --size then is that of pictures at rest");
  auto* rest = add_duration(app, "--rest-for", manners.rest_for_s,
                            "Stop and go: no poses for this long, again and again");
  add_duration(app, "--move-for", manners.move_for_s, "Between two rests")->needs(rest);
  app.add_option("--fps", wishes.fps, "Wanted and nominal frame rate")
      ->check(CLI::Range(1, 240))
      ->capture_default_str();
  app.add_option("--pose-hz", group.pose_hz, "Poses of a script; 0: display rate, 60 or --fps")
      ->check(CLI::Range(0, 1000));
  app.add_option("--max-bitrate-kbps", wishes.max_bitrate_kbps, "0: the server's default")
      ->check(CLI::Range(0, 200'000))
      ->capture_default_str();
  app.add_flag("--fixed-quality", wishes.fixed_quality,
               "Ask the server not to adapt bitrate, size and rate to the link");
  app.add_option("--fov-deg", wishes.fov_y_deg, "Vertical field of view")->capture_default_str();
  auto* stereo = app.add_flag("--stereo", wishes.stereo,
                              "Wear a headset: pictures of both eyes. Sizes are those of an eye");
  app.add_option_function<std::string>(
      "--link", [&group](const std::string& text) { group.link = parse_link("--link", text); },
      "Each session's line: rate=50mbit@0s,5mbit@10s,up=5mbit,delay=20ms,jitter=5ms,"
      "loss=1%,burst=4,queue=200ms,congestion=cubic; each part may be left out");
  auto* glass = add_display_options(app, group.display)->excludes(stereo);
  auto* decode = app.add_flag("--decode", manners.decode, "Decode every frame and check its size");
  app.add_flag("--only-pictures", manners.only_pictures,
               "Decode only what is compared with --check-scene, from an IDR of its own on")
      ->needs(decode)
      ->excludes(glass);
  add_duration(app, "--decode-time", manners.decode_time_s, "Play a decoder that takes this long");
  app.add_flag("--acks,!--no-acks", manners.acknowledge,
               "Whether frames are acknowledged: without, the server must stop sending");
  app.add_option("--flood-hz", manners.flood_hz, "Send so many messages a second too many")
      ->check(CLI::Range(0, 100'000));
  add_duration(app, "--reconnect-every", manners.reconnect_every_s,
               "Drop all sockets at once, again and again");
  add_duration(app, "--leave-every", manners.leave_every_s,
               "Leave as a closed page does; another visitor comes at once, again and again");
  add_duration(app, "--lose-decoder-every", manners.lose_decoder_every_s,
               "Lose the decoder as with the GPU, and continue from an IDR, again and again")
      ->needs(decode);
  add_duration(app, "--stall-at", manners.stall_at_s, "Neither read nor write from here on, …");
  add_duration(app, "--stall-for", manners.stall_for_s, "… for this long");
}

}  // namespace catgs::load
