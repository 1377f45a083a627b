#include <filesystem>
#include <memory>
#include <system_error>

#include <fmt/format.h>

#include "render_core/base/device_set.h"
#include "render_core/base/error.h"
#include "server/config/config.h"
#include "server/net/http.h"

namespace catgs {
namespace {

/// The trees of a cache would be offered as scenes.
void check_cache_dir(const ServerConfig& config) {
  if (config.cache_dir.empty()) return;
  for (const std::string& folder : config.scene_folders)
    if (std::error_code error; std::filesystem::equivalent(folder, config.cache_dir, error))
      throw InputError("--cache-dir " + config.cache_dir, {}, "is a --scene-folder",
                       "name another folder, for trees alone");
}

/// The answers' headers share a buffer of 4096 bytes.
void check_policy(const ServerConfig& config) {
  constexpr std::size_t most_bytes = 2048;
  const std::size_t bytes =
      content_security_policy(config.embed_origins, config.media_origins).size();
  if (bytes > most_bytes)
    throw InputError("--media-origin, --embed-origin", {},
                     fmt::format("make a policy of {} bytes, which each answer says: {} at most",
                                 bytes, most_bytes),
                     "name fewer sites");
}

void check_bind(const std::string& address) {
  const std::size_t colon = address.rfind(':');
  const bool has_port = colon != std::string::npos &&
                        (address.find(':') == colon || address.find("]:") != std::string::npos);
  if (has_port)
    throw InputError("--bind " + address, {}, "has a port",
                     fmt::format("write --bind {} --port {}", address.substr(0, colon),
                                 address.substr(colon + 1)));
}

}  // namespace

void validate(const ServerConfig& config, const ConfigSources& sources) {
  if (config.scenes.empty() && config.scene_folders.empty())
    throw InputError("--scene", {}, "no scene is given",
                     "give a file, or try --scene synth:city:300000");
  check({.kind = config.renderer,
         .pool = {},
         .devices = std::make_shared<DeviceSet>(config.devices)});
  check_cache_dir(config);
  check_policy(config);
  if (config.lod >= 0 && config.gaussian_budget > 0)
    throw InputError("--lod, --budget", {}, "both are given", "give one of them");
  // The default of one is no contradiction to the other.
  if (sources.contains("min-fps") && config.min_fps > config.fps)
    throw InputError(fmt::format("--min-fps {}", config.min_fps), {},
                     fmt::format("is above --fps {}, which no session exceeds", config.fps),
                     fmt::format("give at most {}", config.fps));
  if (!config.revoked_links.empty() && config.token_key_file.empty())
    throw InputError("--revoked-links", {}, "there are no links without --token-key-file",
                     "give the key of the links, or leave this out");
  if (config.tls_cert.empty() != config.tls_key.empty())
    throw InputError(config.tls_cert.empty() ? "--tls-cert" : "--tls-key", {}, "is missing",
                     "--tls-cert and --tls-key belong together");
  check_bind(config.bind);
  if (!is_loopback(config.bind) && !config.asks_for_tokens() && !config.open)
    throw InputError("--bind " + config.bind, {}, "other machines could connect without a token",
                     "give --token-file or --token-key-file, or --open if everybody may");
  if (config.admin_bind == "off") return;
  const Endpoint admin = parse_endpoint(config.admin_bind);
  if (!config.open && !config.admin_open && !is_loopback(admin.address))
    throw InputError("--admin-bind " + config.admin_bind, {}, "metrics have no token",
                     "bind a loopback address, or give --admin-open if that network is private");
  // One listener would take both, whatever the addresses, and answer metrics with the page's 404.
  if (admin.port == config.port && config.port != 0)
    throw InputError(fmt::format("--port {}, --admin-bind {}", config.port, config.admin_bind), {},
                     "page and metrics cannot share a port",
                     "change one of them, or give --admin-bind off");
}

}  // namespace catgs
