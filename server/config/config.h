#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "render_core/frame/renderer.h"
#include "server/encode/encoder.h"
#include "server/net/net_server.h"

namespace catgs {

/// Everything that an operator can set. Each value comes from the strongest of: flag, environment
/// variable CATGS_<NAME>, TOML file, default.
struct ServerConfig {
  std::vector<std::string> scenes;  // paths, or synth:KIND:COUNT[:SEED]
  std::vector<std::string> scene_folders;
  int scene_memory_mb = 0;     // 0: no bound
  std::string cache_dir;       // of trees; empty: none are built
  double detail_px = 0.5;      // of trees: the largest error that is drawn
  int scene_residency_s = 10;  // at least; no setting: tests shorten it
  // Scenes of so many Gaussians get a tree, as do those that do not fit into memory. With fewer, a
  // tree saves a processor nothing. No setting: tests lower it.
  std::uint64_t gaussians_of_a_tree = 2'000'000;
  std::string bind = "127.0.0.1";
  int port = 8080;
  std::string admin_bind = "127.0.0.1:9090";  // address:port or "off"
  std::string visit_counts = "memory";        // "off", "memory", or a folder that keeps them
  std::string client_dir;                     // empty: found beside the program
  RendererKind renderer = RendererKind::automatic;
  std::vector<int> devices;  // of the CUDA core; empty: all
  int threads = 0;           // 0: as many as CpuLimit allows
  int lod = -1;              // of scenes with levels; -1: by gaussian_budget
  int gaussian_budget = 0;   // of scenes with levels; 0: no bound
  std::string up = "auto";   // or the name of an axis
  EncoderKind encoder = EncoderKind::automatic;
  std::string x264_preset = "auto";  // or one of effort_presets
  double x264_aq = default_aq_strength;
  int encoder_threads = 0;  // 0: by sessions and processors
  bool forecasts = true;
  bool quality_ladder = true;
  int fps = 60;
  int bitrate_kbps = 8000;
  int max_sessions = 16;
  int max_sessions_per_address = 64;
  int max_queue = 64;
  int max_spectators = 16;
  int min_fps = 10;
  int idle_timeout_s = 900;  // 0: never
  int drain_wait_s = 4;
  int drain_deadline_s = 10;
  bool open = false;
  bool admin_open = false;
  std::string token_file;
  std::string token_key_file;
  std::string revoked_links;
  std::string resume_key_file;  // empty: that of tokens, else a random key
  std::string tls_cert;
  std::string tls_key;
  std::vector<std::string> allow_origins;
  std::vector<std::string> embed_origins;
  std::vector<std::string> media_origins;
  std::vector<std::string> trusted_proxies;
  std::string log_format = "human";
  std::string log_level = "info";

  /// True if viewers need a token. Otherwise everybody who comes without one may see all scenes.
  [[nodiscard]] bool asks_for_tokens() const {
    return !open && !(token_file.empty() && token_key_file.empty());
  }
};

/// One setting: its name is the flag (--max-sessions), the TOML key (max-sessions) and the
/// environment variable (CATGS_MAX_SESSIONS).
struct Setting {
  enum class Kind { text, number, flag, list };

  std::string name;
  Kind kind;
  std::string value_name;  // in --help: "PORT"
  std::string help;
  /// Takes the value as text (a list setting: all its values); throws std::invalid_argument.
  std::function<void(ServerConfig&, const std::vector<std::string>&)> set;
  /// The value as a TOML literal.
  std::function<std::string(const ServerConfig&)> get;
};

const std::vector<Setting>& settings();

/// Where each value came from, by setting name: "default", "catgs.toml:7", "CATGS_PORT", "--port".
using ConfigSources = std::map<std::string, std::string, std::less<>>;

/// Applies one layer. Each throws InputError that names file and line, variable or flag.
void apply_toml(const std::string& path, ServerConfig& config, ConfigSources& sources);
/// `lookup` is getenv, or a fake.
void apply_environment(const std::function<const char*(const char*)>& lookup, ServerConfig& config,
                       ConfigSources& sources);
/// Returns the environment's `names` that start like settings' variables but are none, with the
/// names probably meant; empty: none. They may belong to other programs (scripts, container links),
/// so the caller only warns.
std::string unknown_variables(const std::vector<std::string>& names);
void apply_flag(const Setting& setting, const std::vector<std::string>& values,
                ServerConfig& config, ConfigSources& sources);

/// Checks combinations of values: missing scenes, half a TLS pair, public access without tokens.
/// Throws InputError with the remedy. `sources` tells which values were given.
void validate(const ServerConfig& config, const ConfigSources& sources = {});

/// The effective configuration as a TOML file, each line with its source.
std::string print_config(const ServerConfig& config, const ConfigSources& sources);

/// "127.0.0.1:9090" or "[::1]:9090". Throws std::invalid_argument.
Endpoint parse_endpoint(std::string_view text);

}  // namespace catgs
