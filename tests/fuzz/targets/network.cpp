#include <algorithm>
#include <array>
#include <cmath>
#include <regex>
#include <variant>

#include <fmt/format.h>

#include "proto/catgs.pb.h"
#include "server/access/access.h"
#include "server/access/session_tokens.h"
#include "server/access/signed_token.h"
#include "server/media/media_type.h"
#include "server/net/http.h"
#include "server/net/path_pattern.h"
#include "server/net/static_files.h"
#include "server/net/trusted_proxies.h"
#include "server/net/wire.h"
#include "server/scenes/link_preview.h"
#include "tests/fuzz/target.h"
#include "tests/server/media/sample_media.h"
#include "tests/support/temporary_folder.h"

namespace catgs::fuzz {
namespace {

/// Written so that a NaN is in no range.
template <class T>
bool in(T value, T low, T high) {
  return value >= low && value <= high;
}

constexpr std::int64_t max_time_us = std::int64_t{1} << 53;

void require_place(const glm::vec3& v) {
  require(in(v.x, -1e9f, 1e9f) && in(v.y, -1e9f, 1e9f) && in(v.z, -1e9f, 1e9f),
          "places are within 1e9");
}

void require_text(const std::string& text, std::size_t max_bytes) {
  require(text.size() <= max_bytes, "texts have an end");
  for (const char c : text)
    require(static_cast<unsigned char>(c) >= 0x20 && c != 0x7f, "texts print nothing else");
}

void require_size(const glm::ivec2& size_px) {
  require(size_px == glm::ivec2(0) || (in(size_px.x, 16, 8192) && in(size_px.y, 16, 8192)),
          "pictures have two sides or none");
}

void require_sound(const PoseSample& sample) {
  const Pose& pose = sample.world_from_camera;
  require_place(pose.position);
  require(in(glm::length(pose.orientation), 0.999f, 1.001f), "orientations have length 1");
  require(in(sample.fov_y_rad, 0.1f, 2.8f), "fields of view are sane");
  require(sample.view_height == 0.0f || in(sample.view_height, 1e-6f, max_coordinate),
          "views have a height");
  require(in(sample.client_time_us, -max_time_us, max_time_us), "times are exact in a browser");
}

void require_sound(const PosePath& path) {
  require(path.samples.size() <= 256, "paths have an end");
  for (const PoseSample& sample : path.samples) require_sound(sample);
  require(std::ranges::is_sorted(path.samples, {}, &PoseSample::client_time_us), "times in order");
}

void require_sound(const Settings& settings) {
  require_size(settings.size_px);
  require_size(settings.still_size_px);
  require(in(settings.max_fps, 0, 240), "rates have an end");
  require(settings.max_bitrate_kbps == 0 || in(settings.max_bitrate_kbps, 100, 200'000),
          "bitrates are sane");
}

void require_sound(const Hello& hello) {
  require(hello.viewport_px.x > 0, "viewports have sides");
  require_size(hello.viewport_px);
  require(hello.decoders.size() <= 8, "decoders are few");
  require_text(hello.scene_id, 128);
  require_text(hello.token, 512);
  require_text(hello.resume_token, 512);
  require_text(hello.watch_token, 512);
  if (hello.resume_pose) require_sound(*hello.resume_pose);
  require_sound(hello.resume_path);
  require_sound(hello.settings);
}

void require_sound(const Ack& ack) {
  for (const std::int64_t time_us : {ack.received_us, ack.decoded_us, ack.presented_us})
    require(in(time_us, std::int64_t{0}, max_time_us), "times are exact in a browser");
  require(ack.pose_age_us <= 10'000'000, "pictures are of the last ten seconds");
}

void require_sound(const SelectScene& wish) { require_text(wish.scene_id, 128); }

void require_sound(const Pick& pick) {
  require_place(pick.origin);
  require(in(glm::length(pick.direction), 0.999f, 1.001f), "directions have length 1");
}

void require_sound(const ClipBox& box) {
  for (int i = 0; i < 3; ++i) {
    require_place(box.axes[i]);
    require(box.low[i] <= box.high[i], "boxes are not empty");
  }
}
void require_sound(const Ping& ping) { require_place(ping.place); }

void require_sound(const Markers& markers) {
  require(markers.points.size() <= 256, "markers are bounded");
  for (const glm::vec3& point : markers.points) require_place(point);
}
void require_sound(const Show& shown) {
  require(shown.tour <= 32 && shown.stop <= 256, "stops are those that tours may have");
}

void require_sound(const Prepare& wish) { require_text(wish.scene_id, 128); }

template <class Message>
void require_sound(const Message&) {}  // nothing in it has a limit

void parse_client_message(Bytes input) {
  const auto parsed = wire::parse_client_message(input);
  if (const auto* error = std::get_if<wire::ParseError>(&parsed))
    throw InputError("message", "", error->what);
  std::visit([](const auto& message) { require_sound(message); }, std::get<ClientMessage>(parsed));
}

void fill(v1::PoseSample& pose, std::uint64_t id) {
  pose.set_pose_id(id);
  pose.set_client_time_us(static_cast<std::int64_t>(id) * 16'667);
  pose.mutable_world_from_camera()->mutable_position()->set_x(1.5f);
  pose.mutable_world_from_camera()->mutable_orientation()->set_w(1.0f);
  pose.set_fov_y_rad(1.0f);
}

std::string hello_bytes() {
  v1::ClientMessage message;
  auto& hello = *message.mutable_hello();
  hello.set_version(1);
  hello.set_scene_id("city");
  hello.set_viewport_width_px(640);
  hello.set_viewport_height_px(360);
  hello.add_decoders(v1::CODEC_H264);
  hello.set_token("open-sesame");
  hello.set_watch("w");
  hello.mutable_resume()->set_token("r");
  fill(*hello.mutable_resume()->mutable_pose(), 7);
  fill(*hello.mutable_resume()->mutable_path()->add_samples(), 8);
  hello.mutable_settings()->set_max_fps(30);
  return message.SerializeAsString();
}

std::map<std::string, std::string> client_message_seeds() {
  std::map<std::string, std::string> seeds = {{"hello", hello_bytes()}};
  const auto add = [&](const char* name, auto change) {
    v1::ClientMessage message;
    change(message);
    seeds[name] = message.SerializeAsString();
  };
  add("pose", [](auto& m) { fill(*m.mutable_pose(), 1); });
  add("path", [](auto& m) {
    for (std::uint64_t id = 1; id < 4; ++id) fill(*m.mutable_path()->add_samples(), id);
  });
  add("ping", [](auto& m) { m.mutable_ping()->mutable_place()->set_y(-1.5f); });
  add("markers", [](auto& m) { m.mutable_markers()->add_points()->set_y(-1.5f); });
  add("show", [](auto& m) { m.mutable_show()->set_stop(2); });
  add("prepare", [](auto& m) { m.mutable_prepare()->set_scene_id("hall"); });
  add("ack", [](auto& m) {
    m.mutable_ack()->set_frame_id(9);
    m.mutable_ack()->set_received_us(10);
    m.mutable_ack()->set_presented_us(30);
  });
  add("settings", [](auto& m) {
    m.mutable_settings()->set_width_px(320);
    m.mutable_settings()->set_height_px(180);
    m.mutable_settings()->set_max_bitrate_kbps(500);
  });
  add("select_scene", [](auto& m) { m.mutable_select_scene()->set_scene_id("garden"); });
  add("request_idr", [](auto& m) { m.mutable_request_idr(); });
  add("pause", [](auto& m) { m.mutable_pause()->set_paused(true); });
  add("bye", [](auto& m) { m.mutable_bye(); });
  add("pick", [](auto& m) { m.mutable_pick()->mutable_direction()->set_z(2.0f); });
  add("clip", [](auto& m) { m.mutable_clip()->mutable_normal()->set_y(1.0f); });
  add("clip_box", [](auto& m) {
    auto& box = *m.mutable_clip()->mutable_box();
    box.mutable_world_from_box()->mutable_orientation()->set_w(1.0f);
    for (const auto set : {&v1::Vec3::set_x, &v1::Vec3::set_y, &v1::Vec3::set_z})
      (box.mutable_half_extent()->*set)(2.0f);
  });
  return seeds;
}

/// Whether a Host header is one of a loopback address or of friend.example, whatever its port.
bool means_this_machine(const std::string& host) {
  static const std::regex ours(R"((friend\.example|localhost|127\.[0-9.]+|\[[01:.]+\])(:[0-9]*)?)",
                               std::regex::icase);
  return host.empty() || std::regex_match(host, ours);
}

/// Without what browsers do not tell apart: capitals, and the usual ports.
std::string authority(std::string text) {
  for (char& c : text)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  for (const std::string_view port : {":443", ":80"})
    if (text.ends_with(port)) text.resize(text.size() - port.size());
  return text;
}

/// What an upload asks of what is there.
void check_precondition(const Precondition& asked) {
  const std::string tag = etag_of("a tour");
  if (asked.if_match.empty() && asked.if_none_match.empty())
    require(asked.holds(tag) && asked.holds(""), "who asks nothing is refused nothing");
  if (!asked.if_match.empty() && asked.holds(tag))
    require(asked.if_match.find(tag) != std::string::npos ||
                asked.if_match.find('*') != std::string::npos,
            "nothing is replaced that was not named");
  require(asked.if_match.empty() || !asked.holds(""), "what is gone matches nothing");
  if (!asked.if_none_match.empty() && !asked.holds(tag))
    require(!asked.if_match.empty() || asked.if_none_match.find(tag) != std::string::npos ||
                asked.if_none_match.find('*') != std::string::npos,
            "what is refused was named");
}

/// Elements of a page's head that hold texts of a scene.
void check_preview(const std::string& title, const std::string& scene_id) {
  const std::string head = preview_elements({.site = "https://a.example",
                                             .scene_id = scene_id,
                                             .title = title,
                                             .about = {.credits = title},
                                             .has_poster = true});
  const auto count = [&](char c) { return std::ranges::count(head, c); };
  require(count('<') == 7 && count('>') == 7 && count('"') == 28, "texts stay in their attributes");
}

/// The lines of a request that decide something: path, Host, Origin, X-Forwarded-For, If-Match and
/// If-None-Match; and a scene's title, which is shown to who asks.
void parse_request(Bytes input) {
  static const test::TemporaryFolder folder;
  static const StaticFiles files = [] {
    folder.write("web/index.html", "page");
    folder.write("web/assets/a.js", "script");
    folder.write("secret", "secret");
    return StaticFiles(folder / "web");
  }();
  static const TrustedProxies proxies({"10.0.0.0/8", "2001:db8::/32"});

  std::array<std::string, 7> lines;
  std::string text = text_of(input);
  for (std::string& line : lines) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    line = text.substr(0, end);
    text.erase(0, end + 1);
  }
  const auto& [path, host, origin, forwarded, if_match, if_none_match, title] = lines;
  const HttpResponse page = files.respond({path, "", false});
  require(page.status == 200 || page.status == 404, "found or not");
  require(page.status == 404 || *page.body != "secret", "nothing beside the client is served");
  if (page.status == 200)
    require(path == "/" || path == "/index.html" || path == "/assets/a.js", "three names");

  if (origin_allowed(origin, host, {"https://friend.example"}) && !origin.empty())
    require(origin == "https://friend.example" ||
                (!authority(host).empty() && authority(origin).ends_with(authority(host))),
            "an origin is listed or this host");
  require(
      means_this_machine(host) || !host_allowed(host, Names::loopback, {"https://friend.example"}),
      "no foreign name is answered on a loopback address");

  require(proxies.client_address("192.0.2.1", forwarded) == "192.0.2.1",
          "strangers are not believed");
  const std::string client = proxies.client_address("10.0.0.1", forwarded);
  require(client.find_first_not_of("0123456789abcdef:.%") == std::string::npos ||
              client.find('%') != std::string::npos,
          "clients have addresses");
  check_precondition({if_match, if_none_match});
  const auto parts = match_path("/api/scenes/{scene...}/media/{name?}", path);
  if (parts)
    require(path == fmt::format("/api/scenes/{}/media/{}", (*parts)[0], (*parts)[1]) &&
                !(*parts)[0].empty() && (*parts)[1].find('/') == std::string_view::npos,
            "a path names one scene and one file");
  check_preview(title, std::string(parts ? (*parts)[0] : path));
  if (page.status == 404 && forwarded.empty() && host.empty())
    throw InputError("request", "", "nothing in it");
}

std::map<std::string, std::string> request_seeds() {
  return {{"page", "/\nlocalhost:8080\nhttp://localhost:8080\n198.51.100.1"},
          {"asset", "/assets/a.js\n[::1]:8080\nhttps://friend.example\n198.51.100.1, 10.1.2.3"},
          {"climb", "/assets/../../secret\n127.0.0.1\nnull\n[2001:db8::1]:4711,10.0.0.2:80"},
          {"upload", "/api/scenes/a b/media/c.jpg\nlocalhost\n\n\n\"x\", " + etag_of("a tour") +
                         "\n*\nThe \"Old\" <Town> & 'Port'"}};
}

const std::string link_key = "0123456789abcdef";

void parse_token(Bytes input) {
  const std::string token = text_of(input);
  const auto grant = read_link_token(token, link_key);
  if (!grant) throw InputError("token", "", "is not ours");
  require(grant->scene_id == "city" || grant->scene_id.empty(), "only what was signed is granted");
}

/// What is behind the signature, as if its key were known: of links, and of lost sessions.
void parse_signed(Bytes input) {
  const std::string payload = text_of(input);
  const SessionTokens sessions(link_key);
  const auto grant = read_link_token(sign_token("catgs-link-v1", payload, link_key), link_key);
  if (grant)
    require(grant->role == "viewer" || grant->role == "spectator" || grant->role == "author" ||
                grant->role == "solo",
            "roles are known ones");
  constexpr std::int64_t now_s = 1'800'000'000;
  const auto resumed =
      sessions.read_resume_token(sign_token("catgs-resume-v1", payload, link_key), now_s);
  if (resumed)
    require(payload.starts_with(resumed->session_id + ":") &&
                payload.ends_with(":" + resumed->scene_id),
            "sessions are those of the token");
  const std::string watch = sign_token("catgs-watch-v1", payload, link_key);
  require(sessions.read_watch_token(watch) == payload, "what was signed is read");
  if (!grant && !resumed) throw InputError("token", "", "has no meaning");
}

std::map<std::string, std::string> signed_seeds() {
  return {{"link", "city\nviewer\n2000000000"},
          {"resume", "12ab34cd:1800000000:old:town"},
          {"long_ago", "12ab34cd:-9223372036854775808:city"}};
}

std::map<std::string, std::string> token_seeds() {
  return {{"city", make_link_token({"city", "viewer", 2'000'000'000}, link_key)},
          {"all", make_link_token({"", "spectator", 1}, link_key)}};
}

/// The first line is the name under which an author sends the rest.
void parse_media(Bytes input) {
  const std::string text = text_of(input);
  const std::size_t end = std::min(text.find('\n'), text.size());
  const std::string name = text.substr(0, end);
  const std::string content = text.substr(std::min(end + 1, text.size()));
  const MediaType* type = media_type_of(content);
  const auto size = image_size(content);
  require(!size || (type && type->kind == MediaKind::image), "pictures alone have sides");
  check_media(name, content);
  require(is_media_name(name) && name.find('/') == name.npos && name.front() != '.',
          "a name is a plain one");
  require(type && media_kind_named(name).has_value(), "what is kept is of a known type");
  if (type->kind == MediaKind::image)
    require(size && in(size->width, 1u, max_picture_side_px) &&
                in(size->height, 1u, max_picture_side_px),
            "pictures that are kept have sides within the limit");
  for (const char* other : {"<", "%PDF", "#!", "{"})
    require(!content.starts_with(other), "neither pages nor programs are kept");
}

std::map<std::string, std::string> media_seeds() {
  return {
      {"png", "a.png\n" + test::png_file(640, 480)},
      {"jpeg", "a.jpg\n" + test::jpeg_file(640, 480)},
      {"webp", "a.webp\n" + std::string("RIFF....WEBPVP8X....\0\0\0\0\x7f\x02\0\xdf\x01\0", 30)},
      {"lossless", "a.webp\n" + std::string("RIFF....WEBPVP8L....\x2f\x7f\xc2\x77\0.....", 30)},
      {"lossy",
       "a.webp\n" + std::string("RIFF....WEBPVP8 ....\0\0\0\x9d\x01\x2a\x80\x02\xe0\x01", 30)},
      {"mp4", "a.mp4\n" + test::mp4_file()},
      {"m4a", "a.m4a\n" + test::mp4_file("M4A ")},
      {"webm", "a.webm\n\x1a\x45\xdf\xa3\x9f\x42\x86\x81\x01\x42\x82\x84webm"},
      {"mp3", "a.mp3\nID3" + std::string(20, '\0')},
      {"vtt", "a.vtt\n" + std::string(test::vtt_file)}};
}

}  // namespace

std::vector<Target> network_targets() {
  return {{.name = "client_message",
           .parse = parse_client_message,
           .seeds = client_message_seeds,
           .dictionary = {std::string("\0\0\xc0\x7f", 4), std::string("\0\0\x80\x7f", 4),
                          std::string("\0\0\x80\x3f", 4), "\xff\xff\xff\xff\xff\xff\xff\xff\xff\1"},
           .max_bytes = 1024},
          {.name = "http",
           .parse = parse_request,
           .seeds = request_seeds,
           .dictionary = {"/index.html", "/assets/", "..", "%2e", "%00", "://", "[::1]",
                          "::ffff:", "10.0.0.1", "2001:db8::", "https://friend.example", ", ",
                          "/api/scenes/", "/tours", "\"", "*", "W/", "&quot;"},
           .max_bytes = 512},
          {.name = "media",
           .parse = parse_media,
           .seeds = media_seeds,
           .dictionary = {".png",     ".jpeg",    ".webp",       ".ogg", ".wav",         "IHDR",
                          "VP8X",     "VP8L",     "VP8 ",        "ftyp", "OggS",         "OpusHead",
                          "RIFF",     "WAVE",     "WEBVTT",      "ID3",  "\xff\xd8\xff", "\xff\xc0",
                          "\xff\xda", "\xff\xfb", "\x9d\x01\x2a"},
           .max_bytes = 1024},
          {.name = "token",
           .parse = parse_token,
           .seeds = token_seeds,
           .dictionary = {".", "=", "-", "_"},
           .max_bytes = 512},
          {.name = "signed_token",
           .parse = parse_signed,
           .seeds = signed_seeds,
           .dictionary = {"viewer", "spectator", "author", "\n", ":", "9223372036854775807",
                          "-9223372036854775808"},
           .max_bytes = 256}};
}

}  // namespace catgs::fuzz
