#include <array>
#include <cmath>

#include "proto/catgs.pb.h"
#include "server/access.h"
#include "server/net/http.h"
#include "server/net/static_files.h"
#include "server/net/trusted_proxies.h"
#include "server/net/wire.h"
#include "tests/fuzz/target.h"
#include "tests/support/temporary_folder.h"

namespace catgs::fuzz {
namespace {

void require_sound(const PoseSample& sample) {
  const Pose& pose = sample.world_from_camera;
  require(std::isfinite(glm::length(glm::dvec3(pose.position))), "positions are finite");
  require(std::abs(glm::length(pose.orientation) - 1.0f) < 1e-3f, "orientations have length 1");
  require(sample.fov_y_rad >= 0.1f && sample.fov_y_rad <= 2.8f, "fields of view are sane");
}

void require_sound(const ClientMessage& message) {
  if (const auto* pose = std::get_if<PoseSample>(&message)) require_sound(*pose);
  if (const auto* path = std::get_if<PosePath>(&message)) {
    require(path->samples.size() <= 256, "paths have an end");
    for (const PoseSample& sample : path->samples) require_sound(sample);
  }
  if (const auto* hello = std::get_if<Hello>(&message)) {
    require(hello->viewport_px.x >= 16 && hello->viewport_px.x <= 8192, "pictures have sides");
    require(hello->scene_id.find('\n') == std::string::npos, "texts have no control characters");
    if (hello->resume_pose) require_sound(*hello->resume_pose);
  }
  if (const auto* pick = std::get_if<Pick>(&message))
    require(std::abs(glm::length(pick->direction) - 1.0f) < 1e-3f, "directions have length 1");
}

void parse_client_message(Bytes input) {
  const auto parsed = wire::parse_client_message(input);
  if (const auto* error = std::get_if<wire::ParseError>(&parsed))
    throw InputError("message", "", error->what);
  require_sound(std::get<ClientMessage>(parsed));
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
  hello.set_device_pixel_ratio(1.0f);
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
  return seeds;
}

/// Whether a Host header is one of a loopback address or of friend.example, whatever its port.
bool means_this_machine(std::string_view host) {
  if (host.starts_with('[')) host = host.substr(1, host.find(']') - 1);
  const std::string_view name = host.substr(0, host.find(':'));
  const bool is_ipv4 = name.find_first_not_of("0123456789.") == std::string_view::npos;
  const bool is_ipv6 = host.find(':') < host.find_first_not_of("01:.");
  return host.empty() || name == "friend.example" || name == "localhost" ||
         (is_ipv4 && name.starts_with("127.")) || is_ipv6;
}

/// The lines of a request that decide something: path, Host, Origin, X-Forwarded-For.
void parse_request(Bytes input) {
  static const test::TemporaryFolder folder;
  static const StaticFiles files = [] {
    folder.write("web/index.html", "page");
    folder.write("web/assets/a.js", "script");
    folder.write("secret", "secret");
    return StaticFiles(folder / "web");
  }();
  static const TrustedProxies proxies({"10.0.0.0/8", "2001:db8::/32"});

  std::array<std::string, 4> lines;
  std::string text = text_of(input);
  for (std::string& line : lines) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    line = text.substr(0, end);
    text.erase(0, end + 1);
  }
  const auto& [path, host, origin, forwarded] = lines;
  const HttpResponse page = files.respond({path, "", false});
  require(page.status == 200 || page.status == 404, "found or not");
  require(page.status == 404 || *page.body != "secret", "nothing beside the client is served");
  if (page.status == 200)
    require(path == "/" || path == "/index.html" || path == "/assets/a.js", "three names");

  if (origin_allowed(origin, host, {"https://friend.example"}) && !origin.empty())
    require(origin == "https://friend.example" || (!host.empty() && origin.ends_with(host)),
            "an origin is listed or this host");
  require(means_this_machine(host) || !loopback_host_allowed(host, {"https://friend.example"}),
          "no foreign name is answered on a loopback address");

  require(proxies.client_address("192.0.2.1", forwarded) == "192.0.2.1",
          "strangers are not believed");
  const std::string client = proxies.client_address("10.0.0.1", forwarded);
  require(client.find_first_not_of("0123456789abcdef:.%") == std::string::npos ||
              client.find('%') != std::string::npos,
          "clients have addresses");
  if (page.status == 404 && forwarded.empty() && host.empty())
    throw InputError("request", "", "nothing in it");
}

std::map<std::string, std::string> request_seeds() {
  return {{"page", "/\nlocalhost:8080\nhttp://localhost:8080\n198.51.100.1"},
          {"asset", "/assets/a.js\n[::1]:8080\nhttps://friend.example\n198.51.100.1, 10.1.2.3"},
          {"climb", "/assets/../../secret\n127.0.0.1\nnull\n[2001:db8::1]:4711,10.0.0.2:80"}};
}

const std::string link_key = "0123456789abcdef";

void parse_token(Bytes input) {
  const std::string token = text_of(input);
  const auto grant = read_link_token(token, link_key);
  if (!grant) throw InputError("token", "", "is not ours");
  require(grant->scene_id == "city" || grant->scene_id.empty(), "only what was signed is granted");
}

std::map<std::string, std::string> token_seeds() {
  return {{"city", make_link_token({"city", "viewer", 2'000'000'000}, link_key)},
          {"all", make_link_token({"", "spectator", 1}, link_key)}};
}

}  // namespace

Target client_message() {
  return {.name = "client_message",
          .parse = parse_client_message,
          .seeds = client_message_seeds,
          .dictionary = {std::string("\0\0\xc0\x7f", 4), std::string("\0\0\x80\x7f", 4),
                         std::string("\0\0\x80\x3f", 4), "\xff\xff\xff\xff\xff\xff\xff\xff\xff\1"},
          .max_bytes = 1024};
}

Target http() {
  return {.name = "http",
          .parse = parse_request,
          .seeds = request_seeds,
          .dictionary = {"/index.html", "/assets/", "..", "%2e", "%00", "://", "[::1]",
                         "::ffff:", "10.0.0.1", "2001:db8::", "https://friend.example", ", "},
          .max_bytes = 512};
}

Target token() {
  return {.name = "token",
          .parse = parse_token,
          .seeds = token_seeds,
          .dictionary = {".", "=", "-", "_"},
          .max_bytes = 512};
}

}  // namespace catgs::fuzz
