// The table of settings.
#include <algorithm>
#include <charconv>
#include <iterator>
#include <stdexcept>
#include <type_traits>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "render_core/base/device_set.h"
#include "server/config/config.h"
#include "server/net/http.h"

namespace catgs {
namespace {

using Values = std::vector<std::string>;

// Not "quoted": for a std::string argument that name also finds std::quoted.
std::string toml_string(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += c;
  }
  return out + "\"";
}

const std::string& single(const Values& values) {
  if (values.size() != 1) throw std::invalid_argument("one value is expected");
  return values.front();
}

/// An int, or a double.
template <class T>
T parse_number(std::string_view text, T low, T high) {
  T value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !(value >= low && value <= high))
    throw std::invalid_argument(fmt::format("\"{}\" is not a {} in {}…{}", text,
                                            std::is_integral_v<T> ? "whole number" : "number", low,
                                            high));
  return value + T{0};  // -0 is 0
}

template <class T>
Setting number(std::string name, std::string value_name, std::string help, T ServerConfig::*member,
               T low, T high) {
  return {std::move(name),
          Setting::Kind::number,
          std::move(value_name),
          std::move(help),
          [=](ServerConfig& c, const Values& v) { c.*member = parse_number(single(v), low, high); },
          [=](const ServerConfig& c) { return fmt::format("{}", c.*member); }};
}

Setting text(std::string name, std::string value_name, std::string help,
             std::string ServerConfig::*member) {
  return {std::move(name),
          Setting::Kind::text,
          std::move(value_name),
          std::move(help),
          [=](ServerConfig& c, const Values& v) { c.*member = single(v); },
          [=](const ServerConfig& c) { return toml_string(c.*member); }};
}

Setting list(std::string name, std::string value_name, std::string help,
             std::vector<std::string> ServerConfig::*member) {
  return {std::move(name),
          Setting::Kind::list,
          std::move(value_name),
          std::move(help),
          [=](ServerConfig& c, const Values& v) { c.*member = v; },
          [=](const ServerConfig& c) {
            std::vector<std::string> items;
            for (const auto& item : c.*member) items.push_back(toml_string(item));
            return fmt::format("[{}]", fmt::join(items, ", "));
          }};
}

Setting flag(std::string name, std::string help, bool ServerConfig::*member) {
  return {std::move(name),
          Setting::Kind::flag,
          "",
          std::move(help),
          [=](ServerConfig& c, const Values& v) {
            const std::string& value = single(v);
            if (value != "true" && value != "false")
              throw std::invalid_argument("\"" + value + "\" is neither true nor false");
            c.*member = value == "true";
          },
          [=](const ServerConfig& c) { return c.*member ? "true" : "false"; }};
}

template <typename T>
using Choices = std::vector<std::pair<std::string, T>>;

template <typename T>
Setting choice(std::string name, std::string help, T ServerConfig::*member, Choices<T> choices) {
  std::string names;
  for (const auto& c : choices) names += (names.empty() ? "" : "|") + c.first;
  return {std::move(name),
          Setting::Kind::text,
          names,
          std::move(help),
          [=](ServerConfig& config, const Values& v) {
            const auto it =
                std::ranges::find(choices, single(v), &std::pair<std::string, T>::first);
            if (it == choices.end())
              throw std::invalid_argument("\"" + v.front() + "\" is not one of " + names);
            config.*member = it->second;
          },
          [=](const ServerConfig& config) {
            const auto it =
                std::ranges::find(choices, config.*member, &std::pair<std::string, T>::second);
            return toml_string(it->first);
          }};
}

Choices<std::string> words(std::initializer_list<const char*> list_of_words) {
  Choices<std::string> choices;
  for (const char* word : list_of_words) choices.emplace_back(word, word);
  return choices;
}

Choices<bool> on_or_off() { return {{"on", true}, {"off", false}}; }

Setting device() {
  return {"device", Setting::Kind::text, "all|N[,N...]",
          "CUDA devices that render, by CUDA's numbers; each holds a copy of the scenes",
          // A TOML array comes as several values.
          [](ServerConfig& c, const Values& v) {
            c.devices = parse_devices(fmt::format("{}", fmt::join(v, ",")));
          },
          [](const ServerConfig& c) { return toml_string(devices_text(c.devices)); }};
}

Setting admin_bind() {
  Setting setting =
      text("admin-bind", "ADDRESS:PORT",
           "Address of /metrics, /visits and /api/sessions; off: none", &ServerConfig::admin_bind);
  setting.set = [](ServerConfig& c, const Values& v) {
    if (single(v) != "off") parse_endpoint(v.front());
    c.admin_bind = v.front();
  };
  return setting;
}

Setting trusted_proxy() {
  Setting setting =
      list("trusted-proxy", "CIDR",
           "Networks of proxies whose X-Forwarded-For is believed, such as 10.0.0.0/8",
           &ServerConfig::trusted_proxies);
  setting.set = [](ServerConfig& c, const Values& v) {
    [[maybe_unused]] const TrustedProxies valid{v};  // throws else
    c.trusted_proxies = v;
  };
  return setting;
}

/// "*" stands for all.
Setting origins(std::string name, std::string help, std::vector<std::string> ServerConfig::*member,
                bool any_subdomain) {
  Setting setting = list(std::move(name), "ORIGIN", std::move(help), member);
  setting.set = [=](ServerConfig& c, const Values& v) {
    for (const auto& origin : v)
      if (origin != "*") check_origin(origin, any_subdomain);
    c.*member = v;
  };
  return setting;
}

Setting media_origin() {
  Setting setting = list("media-origin", "ORIGIN",
                         "Sites whose pictures, films and sounds tours may show, such as "
                         "https://media.example",
                         &ServerConfig::media_origins);
  setting.set = [](ServerConfig& c, const Values& v) {
    for (const auto& origin : v) {
      check_origin(origin, false);
      if (!origin.starts_with("https://"))
        throw std::invalid_argument("\"" + origin + "\" is no https site");
    }
    c.media_origins = v;
  };
  return setting;
}

std::vector<Setting> scene_settings() {
  using C = ServerConfig;
  return {
      list("scene", "PATH",
           "Scene files or folders, or synth:KIND:COUNT[:SEED] (city, garden); loaded at the start",
           &C::scenes),
      list("scene-folder", "DIR",
           "Folders of scenes that are loaded when somebody asks; the server finds new ones",
           &C::scene_folders),
      number("scene-memory", "MB",
             "Memory for all scenes on each device; for more, the least recently used scene of "
             "--scene-folder is released. Half of it is for the pages of all .tree scenes, while "
             "there are any. 0: no bound, and 4 GiB for these pages",
             &C::scene_memory_mb, 0, 10'000'000),
      text("cache-dir", "DIR",
           "Folder in which the server keeps trees of large scenes, walkable areas and posters; "
           "empty: it keeps none",
           &C::cache_dir),
      number("detail", "PX",
             "Scenes in a .tree: largest error that is drawn, pixels; 0: every Gaussian",
             &C::detail_px, 0.0, 64.0),
      choice<std::string>("up", "Axis that points up in scenes whose sidecar does not say so",
                          &C::up, words({"auto", "+x", "-x", "+y", "-y", "+z", "-z"})),
      text("bind", "ADDRESS", "Address to listen on; 0.0.0.0 or :: is every interface", &C::bind),
      number("port", "PORT", "Port to listen on; 0: the system chooses", &C::port, 0, 65535),
      admin_bind(),
      text(
          "visit-counts", "off|memory|DIR",
          "Counts of visits by scene and day, at /visits of the admin port: none, until the server "
          "ends, or kept in a folder",
          &C::visit_counts),
      text("client-dir", "DIR", "Folder of the built browser client; by default beside the program",
           &C::client_dir),
  };
}

std::vector<Setting> picture_settings() {
  using C = ServerConfig;
  return {
      choice<RendererKind>(
          "renderer", "Core that renders; auto: CUDA if a device works, else the CPU", &C::renderer,
          {{"auto", RendererKind::automatic},
           {"cpu", RendererKind::cpu},
           {"cuda", RendererKind::cuda}}),
      device(),
      number("threads", "N",
             "Threads that render and encode; 0: as many as its processors and CPU quota keep busy",
             &C::threads, 0, 1024),
      number("lod", "N",
             "Streamed SOG, 3D Tiles, LCC2: level of detail, 0 is the finest; -1: by --budget",
             &C::lod, -1, 1000),
      number("budget", "N",
             "Streamed SOG, 3D Tiles, LCC2: the finest levels with at most so many Gaussians; 0: "
             "no bound",
             &C::gaussian_budget, 0, 1'000'000'000),
      choice<EncoderKind>("encoder", "Video encoder", &C::encoder,
                          {{"auto", EncoderKind::automatic},
                           {"nvenc", EncoderKind::nvenc},
                           {"x264", EncoderKind::x264},
                           {"jpeg", EncoderKind::jpeg}}),
      choice<std::string>("x264-preset", "Preset of libx264; auto: by how busy the processors are",
                          &C::x264_preset,
                          words({"auto", "ultrafast", "ultrafast-subpel", "superfast"})),
      number("x264-aq", "STRENGTH",
             "Adaptive quantisation of libx264 from superfast on: more evens out flat parts, less "
             "keeps edges; 0: none",
             &C::x264_aq, 0.0, max_aq_strength),
      number("encoder-threads", "N",
             "Threads of each encoder; libx264 takes two at most. 0: by sessions and processors",
             &C::encoder_threads, 0, max_encoder_threads),
      choice<bool>("forecasts", "Draw what the camera is expected to see when the picture is shown",
                   &C::forecasts, on_or_off()),
      choice<bool>("quality-ladder",
                   "Lower size and frame rate where a link or a decoder is slow; off: only the "
                   "bitrate",
                   &C::quality_ladder, on_or_off()),
      number("fps", "N", "Nominal frame rate of a session", &C::fps, 1, 240),
      number("bitrate", "KBPS", "Video bitrate of a session, kbit/s", &C::bitrate_kbps, 100,
             200'000),
  };
}

std::vector<Setting> session_settings() {
  using C = ServerConfig;
  return {
      number("max-sessions", "N", "Most sessions at the same time", &C::max_sessions, 1, 10'000),
      number("min-fps", "N",
             "Admit sessions while measured costs let all keep this frame rate; 0: no such limit",
             &C::min_fps, 0, 240),
      number("max-sessions-per-address", "N", "Most sessions at the same time from one address",
             &C::max_sessions_per_address, 1, 10'000),
      number("max-queue", "N", "Most clients that may wait for a place; others are refused",
             &C::max_queue, 0, 10'000),
      number("idle-timeout", "SECONDS",
             "End a session when nothing has moved for this long; 0: never", &C::idle_timeout_s, 0,
             86'400),
      number("max-spectators", "N", "Most clients that may watch one session; 0: none",
             &C::max_spectators, 0, 1000),
      number("drain-wait", "SECONDS",
             "After SIGTERM, time for proxies to see /readyz fail before clients move",
             &C::drain_wait_s, 0, 600),
      number("drain-deadline", "SECONDS",
             "After --drain-wait, time for clients to move to another server", &C::drain_deadline_s,
             0, 3600),
  };
}

std::vector<Setting> access_settings() {
  using C = ServerConfig;
  return {
      flag("open", "Show scenes without a token, to other machines too", &C::open),
      flag("admin-open", "Allow an --admin-bind beyond loopback, for a private network",
           &C::admin_open),
      text("token-file", "FILE", "Access tokens, one per line; read again when it changes",
           &C::token_file),
      text("token-key-file", "FILE", "Key of the expiring links that 'catgs-server token' makes",
           &C::token_key_file),
      text("revoked-links", "FILE", "Ids of links that are refused, one per line; read again",
           &C::revoked_links),
      text("resume-key-file", "FILE",
           "Key that the servers of a fleet share, so that sessions can move between them "
           "[the key of tokens, or a random one]",
           &C::resume_key_file),
      text("tls-cert", "FILE", "Certificate chain, PEM: serve https and wss", &C::tls_cert),
      text("tls-key", "FILE", "Private key of the certificate, PEM", &C::tls_key),
      origins("allow-origin",
              "Sites whose pages may connect, such as https://a.example; *: all. A server on "
              "loopback or without tokens answers to their names, too",
              &C::allow_origins, false),
      origins("embed-origin", "Sites that may show the client in a frame; *: all",
              &C::embed_origins, true),
      media_origin(),
      trusted_proxy(),
      choice<std::string>("log-format", "Format of the log on standard error", &C::log_format,
                          words({"human", "json"})),
      choice<std::string>("log-level", "Lowest level that is logged", &C::log_level,
                          words({"debug", "info", "warn", "error"})),
  };
}

/// In the order of --help.
std::vector<Setting> make_settings() {
  std::vector<Setting> all;
  for (auto* part : {scene_settings, picture_settings, session_settings, access_settings})
    std::ranges::move(part(), std::back_inserter(all));
  return all;
}

}  // namespace

const std::vector<Setting>& settings() {
  static const std::vector<Setting> all = make_settings();
  return all;
}

Endpoint parse_endpoint(std::string_view text_value) {
  const auto colon = text_value.rfind(':');
  if (colon == std::string_view::npos || colon == 0)
    throw std::invalid_argument("\"" + std::string(text_value) + "\" is not ADDRESS:PORT");
  std::string_view address = text_value.substr(0, colon);
  if (address.starts_with('[') && address.ends_with(']'))
    address = address.substr(1, address.size() - 2);
  return {std::string(address), parse_number(text_value.substr(colon + 1), 0, 65535)};
}

}  // namespace catgs
