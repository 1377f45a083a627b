#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <glm/vec2.hpp>

#include "render_core/base/cli_fwd.h"
#include "render_core/motion/script.h"
#include "tests/load/link.h"

namespace catgs::load {

inline constexpr const char* unnamed_group = "all";

/// A client's requests to the server.
struct Wishes {
  std::string scene;  // empty: the server's first
  int fps = 60;
  int max_bitrate_kbps = 0;    // 0: the server's default
  bool fixed_quality = false;  // the server keeps bitrate, size and rate, whatever the link does
  float fov_y_deg = 60.0f;
  bool stereo = false;  // both eyes of a headset; sizes are those of one
};

/// How well a client behaves. Times are seconds.
struct Manners {
  double move_for_s = 0.0;  // stop and go: poses for this long, …
  double rest_for_s = 0.0;  // … then none for this long; 0: never
  bool decode = false;
  bool only_pictures = false;      // decode around the pictures that are kept, not all of the time
  double decode_time_s = 0.0;      // that decoding a frame takes, at least
  bool acknowledge = true;         // false plays a client that has stopped reading its screen
  int flood_hz = 0;                // messages a second beyond what a client would send
  double reconnect_every_s = 0.0;  // 0: never; all sockets are dropped at the same time
  double leave_every_s = 0.0;      // 0: never; the visitor leaves, and another one comes at once
  double lose_decoder_every_s = 0.0;  // 0: never; the decoder and its queue are gone, as with a GPU
  double stall_at_s = 0.0;   // neither reads nor writes from here on, as a stopped process …
  double stall_for_s = 0.0;  // … for this long; 0: no stall
};

/// How the page's newest picture is warped to its newest camera.
enum class WarpMode { automatic, turn, plane, off };

/// How a client shows its frames: as the page does.
struct DisplayOptions {
  bool judged = false;  // by exact pictures, after the run
  int hz = 60;
  // automatic: as the page, by depths; where they are missing, plane for orbits, else turn.
  WarpMode warp = WarpMode::automatic;
  bool depths = false;  // asks for them: set by `warp`
  // Sides of pictures over those of the view; nothing: chosen by the motion, as the page does.
  std::optional<glm::dvec2> overscan{};
};

/// Clients that are alike. Times are seconds since the run began.
struct GroupOptions {
  std::string name = unnamed_group;
  int sessions = 1;
  double start_s = 0.0;
  double ramp_s = 0.0;  // spreads the starts
  double end_s = 0.0;   // 0: the run's end

  // From where they look. Sessions take turns through traces and sizes.
  std::vector<std::string> traces;
  bool anchor = false;
  ScriptOptions script;
  int pose_hz = 0;  // of a script; 0: display rate, as browsers do: 60, or fps where that is more
  std::vector<std::string> sizes = {"1280x720"};
  std::string moving_size;  // smaller than those while the camera moves; empty: as they are

  Wishes wishes;
  Manners manners;
  DisplayOptions display;
  LinkSettings link;
};

/// Declares the options of a group: flags of the command line, keys of a scenario's clients.
void add_client_options(CLI::App& app, GroupOptions& group);
/// An option whose value is a duration, such as 500ms.
CLI::Option* add_duration(CLI::App& app, const std::string& flag, double& seconds,
                          const std::string& help = {});

/// Something that happens to the server during a run.
struct TimedAction {
  double at_s = 0.0;
  std::function<void()> action;
  bool recovers = false;  // from here on sessions are timed until their next frame
};

struct LoadOptions {
  std::string url;
  std::string token;
  bool insecure = false;
  double duration_s = 30.0;
  std::vector<GroupOptions> groups;  // with different names
  int pictures = 0;  // decoded frames that sessions keep for check_pictures(), in all
  std::vector<TimedAction> actions;
};

}  // namespace catgs::load
