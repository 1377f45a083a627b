// Integration: who may connect, and by which certificate. Real sockets on loopback, a whole server
// in this process.

#include <boost/system/system_error.hpp>
#include <fmt/format.h>

#include "tests/server/net/suite_server.h"
#include "tests/support/raw_socket.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test.h"
#include "tests/support/tls.h"

namespace catgs::test {
namespace {

const std::vector<std::string> two_scenes = {"synth:city:2000", "synth:garden:2000"};

/// A server that asks for a token, for cases that change nothing for each other.
const RunningServer& guarded_server() {
  static auto& server = *new SuiteServer([](ServerConfig& config) {
    config.scenes = two_scenes;
    config.token_file = static_token_file();
    config.token_key_file = link_key_file();
  });
  return server.get();
}

TEST(ServerAccess, LimitsTheAddressesBehindAProxy) {
  const auto one_each = [](ServerConfig& config) { config.max_sessions_per_address = 1; };
  const auto via_proxy = [](const std::string& client) {
    return WireClient::Options{.origin = "", .forwarded_for = client};
  };
  const auto refused = [](WireClient& client) {
    client.send(hello_by(""));
    for (bool full = false;;) {
      const Received received = client.receive();
      if (received.closed) return full;
      if (received.message && received.message->has_welcome()) return false;
      if (received.message && received.message->has_error())
        full = received.message->error().code() == v1::Error::SERVER_FULL;
    }
  };
  RunningServer behind([&](ServerConfig& config) {
    one_each(config);
    config.trusted_proxies = {"127.0.0.0/8"};
  });
  WireClient a(behind.port(), via_proxy("198.51.100.1"));
  WireClient b(behind.port(), via_proxy("198.51.100.2"));
  WireClient c(behind.port(), via_proxy("198.51.100.9, 198.51.100.1"));
  EXPECT_FALSE(refused(a));
  EXPECT_FALSE(refused(b)) << "another visitor of the same proxy";
  EXPECT_TRUE(refused(c)) << "what the visitor made up counts for nothing";

  RunningServer alone(one_each);
  WireClient d(alone.port(), via_proxy("198.51.100.1"));
  WireClient e(alone.port(), via_proxy("198.51.100.2"));
  EXPECT_FALSE(refused(d));
  EXPECT_TRUE(refused(e)) << "nobody is believed unasked";
}

TEST(ServerAccess, AnswersNoForeignOriginProtocolOrName) {
  RunningServer server(
      [](ServerConfig& config) { config.allow_origins = {"https://friend.example"}; });
  const std::string own = "http://127.0.0.1:" + std::to_string(server.port());
  EXPECT_NO_THROW(WireClient(server.port(), {own, "catgs.v1"}));
  EXPECT_NO_THROW(WireClient(server.port(), {"https://friend.example", "catgs.v1"}));
  EXPECT_THROW(WireClient(server.port(), {"https://evil.example", "catgs.v1"}),
               boost::system::system_error);
  EXPECT_THROW(WireClient(server.port(), {"", "catgs.v99"}), boost::system::system_error);
  EXPECT_THROW(WireClient(server.port(), {"", ""}), boost::system::system_error);
  // What a page of evil.example sends after its name was made to resolve to 127.0.0.1.
  for (const int port : {server.port(), server.admin_port()}) {
    const HttpReply refused = http_get(port, "/api/scenes", {{"host", "evil.example:8080"}});
    EXPECT_EQ(refused.status, 403);
    EXPECT_THAT(refused.body, HasSubstr("--allow-origin https://evil.example:8080"));
    EXPECT_THAT(http_get(port, "/", {{"host", std::string(101, 'e')}}).body,
                HasSubstr("https://" + std::string(100, 'e') + "...\n"));
  }
  EXPECT_EQ(http_get(server.port(), "/api/scenes", {{"host", "friend.example"}}).status, 200);
  EXPECT_EQ(http_get(server.port(), "/api/scenes", {{"host", "localhost"}}).status, 200);
  const WireClient::Options rebound{"http://evil.example:8080", "catgs.v1", "evil.example:8080"};
  EXPECT_THROW(WireClient(server.port(), rebound), boost::system::system_error);
}

TEST(ServerAccess, AnswersNoForeignNameWhereNoTokenIsAskedFor) {
  // The same page, in the browser of somebody whose network an open server serves.
  const auto on_all_addresses = [](ServerConfig& config) {
    config.bind = "0.0.0.0";
    config.admin_bind = "0.0.0.0:0";
    config.open = true;
    config.trusted_proxies = {"127.0.0.0/8"};
  };
  const auto status = [](int port, const std::string& host, const std::string& proto = "http") {
    return http_get(port, "/api/scenes", {{"host", host}, {"x-forwarded-proto", proto}}).status;
  };
  RunningServer open(on_all_addresses);
  for (const int port : {open.port(), open.admin_port()}) {
    const HttpReply refused = http_get(port, "/api/scenes", {{"host", "evil.example:8080"}});
    EXPECT_EQ(refused.status, 403);
    EXPECT_THAT(refused.body, HasSubstr("--allow-origin http://evil.example:8080"));
  }
  for (const char* host : {"localhost", "192.0.2.1:8080", "museum-pc", "museum-pc.local:8080"})
    EXPECT_EQ(status(open.port(), host), 200) << host;
  for (const char* scheme : {"https", "wss"})
    EXPECT_EQ(status(open.port(), "tours.example", scheme), 200) << "its certificate was looked at";
  EXPECT_EQ(status(open.port(), "tours.example", "ws"), 403);
  const WireClient::Options rebound{"http://evil.example:8080", "catgs.v1", "evil.example:8080"};
  EXPECT_THROW(WireClient(open.port(), rebound), boost::system::system_error);

  RunningServer guarded([&](ServerConfig& config) {
    on_all_addresses(config);
    config.open = false;
    config.admin_open = true;
    config.token_file = static_token_file();
  });
  EXPECT_EQ(status(guarded.port(), "tours.example"), 401) << "it keeps such pages out by its token";
}

TEST(ServerAccess, NoPathHidesAForeignName) {
  // libwebsockets decodes them before it looks for the end of the line.
  const RunningServer& server = shared_server();
  for (const int port : {server.port(), server.admin_port()})
    for (const char* path : {"/healthz%0a%0a", "/healthz%0aHost:[::1]", "/healthz%0aHost:localhost",
                             "/healthz%0d%0a%0d%0a", "/healthz%0d", "/healthz%0ahttp/1.1",
                             "/healthz%0ahttp/1.1%20HTTP/1.0", "/healthz%0aHost:localhost%0a%0a"}) {
      const auto request = fmt::format("GET {} HTTP/1.1\r\nHost: evil.example\r\n\r\n", path);
      EXPECT_THAT(raw_answer(port, request), Not(HasSubstr(" 200 "))) << path;
    }
}

TEST(ServerAccess, LinksOpenTheirSceneOnly) {
  const RunningServer& server = guarded_server();
  const std::string link = make_link("viewer", "city");
  WireClient guest(server.port());
  EXPECT_THAT(guest.greet(64, 64, v1::CODEC_H264, link).scene_ids(), ElementsAre("city"));

  v1::ClientMessage select;
  select.mutable_select_scene()->set_scene_id("garden");
  guest.send(select);
  const auto error = guest.receive_message(v1::ServerMessage::kError).error();
  EXPECT_EQ(error.code(), v1::Error::UNAUTHORIZED);
  EXPECT_FALSE(error.fatal());
  select.mutable_select_scene()->set_scene_id("city");
  guest.send(select);
  EXPECT_EQ(guest.receive_message(v1::ServerMessage::kWelcome).welcome().scene().scene_id(),
            "city");

  const auto scenes = [&](const std::string& token) {
    return http_get(server.port(), "/api/scenes", bearer(token));
  };
  EXPECT_THAT(scenes(link).body, AllOf(HasSubstr("\"city\""), Not(HasSubstr("garden"))));
  EXPECT_EQ(scenes("guess").status, 401);
  const HttpReply stranger = http_get(server.port(), "/api/scenes");
  EXPECT_EQ(stranger.status, 401);
  EXPECT_THAT(stranger.body, AllOf(HasSubstr("Bearer"), Not(HasSubstr("city"))));
}

TEST(ServerAccess, ALinkWithoutASceneInTheAddressOpensTheSceneOfItsToken) {
  RunningServer server([&](ServerConfig& config) {
    config.scenes = two_scenes;
    config.token_key_file = link_key_file();
    config.open = true;
  });
  WireClient author(server.port());
  EXPECT_EQ(author.greet(hello_by(make_link("author", "garden"))).scene().scene_id(), "garden");
  WireClient anybody(server.port());
  EXPECT_EQ(anybody.greet(64, 64).scene_ids_size(), 2);
}

TEST(ServerAccess, AdmitsByTokenAndNeverSaysIt) {
  const RunningServer& server = guarded_server();
  EXPECT_EQ(refusal(server.port(), hello_by("")).code(), v1::Error::UNAUTHORIZED);
  WireClient guest(server.port());
  guest.greet(hello_by(static_token));
  EXPECT_THAT(http_get(server.admin_port(), "/api/sessions").body, Not(HasSubstr("sesame")));
}

TEST(ServerAccess, ARevokedLinkEndsItsSessionsAndNoOthers) {
  const TemporaryFolder folder;
  const auto revoked = folder.write("revoked", "");
  RunningServer server([&](ServerConfig& config) {
    config.token_key_file = link_key_file();
    config.revoked_links = revoked.string();
  });
  const auto by_link = [&](const std::string& id) {
    return hello_by(make_link("viewer", "city", id));
  };
  WireClient kept(server.port()), lost(server.port()), looks_on(server.port());
  const std::string watch = kept.greet(by_link("aaaa")).watch_token();
  kept.present();
  v1::ClientMessage resuming = by_link("bbbb");
  resuming.mutable_hello()->mutable_resume()->set_token(lost.greet(by_link("bbbb")).resume_token());
  v1::ClientMessage watching = by_link("bbbb");
  watching.mutable_hello()->set_watch(watch);
  looks_on.greet(watching);

  folder.write("revoked", "bbbb # found on the net\n");
  for (WireClient* client : {&lost, &looks_on}) {
    std::optional<v1::Error> error;
    client->receive_until_closed(&error);
    ASSERT_TRUE(error);
    EXPECT_EQ(error->code(), v1::Error::UNAUTHORIZED);
  }
  for (const v1::ClientMessage& again : {by_link("bbbb"), resuming, watching}) {
    EXPECT_EQ(refusal(server.port(), again).code(), v1::Error::UNAUTHORIZED);
  }
  const auto by_revoked = bearer(make_link("viewer", "city", "bbbb"));
  EXPECT_EQ(http_get(server.port(), "/api/scenes", by_revoked).status, 401);
  kept.send_pose(1);
  EXPECT_EQ(kept.receive_frame().header.pose_id(), 1u) << "the other link's session goes on";
}

TEST(ServerAccess, ARequestHasOneToken) {
  const auto answer_to = [&](const std::string& headers) {
    return raw_answer(guarded_server().port(),
                      "GET /api/scenes HTTP/1.1\r\nHost: localhost\r\n" + headers + "\r\n");
  };
  const std::string one = std::string("Authorization: Bearer ") + static_token + "\r\n";
  EXPECT_THAT(answer_to(one), StartsWith("HTTP/1.1 200 "));
  EXPECT_THAT(answer_to(one + one), StartsWith("HTTP/1.1 401 "));
  // A proxy's own login takes the place of ours.
  const std::string login = "Authorization: Basic dXNlcjpzZWNyZXQ=\r\n";
  EXPECT_THAT(answer_to(login), StartsWith("HTTP/1.1 401 "));
  EXPECT_THAT(answer_to(login + "Catgs-Token: " + static_token + "\r\n"),
              StartsWith("HTTP/1.1 200 "));
  EXPECT_THAT(answer_to("Catgs-Token: guess\r\n"), StartsWith("HTTP/1.1 401 "));
}

TEST(ServerAccess, PreviewsTellWhatStrangersMaySee) {
  const TemporaryFolder folder;
  folder.write("web/index.html", "<!doctype html><head></head>");
  const auto web = [&](ServerConfig& config) {
    config.client_dir = (folder / "web").string();
    config.scenes = two_scenes;
    config.trusted_proxies = {"127.0.0.0/8"};
  };
  RunningServer open(web);
  const std::string own = "http://127.0.0.1:" + std::to_string(open.port());
  const HttpReply first = http_get(open.port(), "/");
  EXPECT_THAT(first.body,
              AllOf(HasSubstr("og:title\" content=\"city\""),
                    HasSubstr(own + "/api/scenes/city/poster.jpg"), EndsWith("</head>")));
  EXPECT_EQ(http_get(open.port(), "/", {{"if-none-match", first.headers.at("etag")}}).status, 304);
  EXPECT_EQ(http_get(open.port(), "/api/scenes/city/poster.jpg").status, 200) << "it is there";
  const HttpReply garden = http_get(open.port(), "/?ui=0&scene=garden",
                                    {{"host", "localhost"}, {"x-forwarded-proto", "https"}});
  EXPECT_THAT(garden.body, HasSubstr("https://localhost/api/scenes/garden/poster.jpg"));
  EXPECT_THAT(http_get(open.port(), "/?scene=atlantis").body, Not(HasSubstr("og:")));

  RunningServer guarded([&](ServerConfig& config) {
    web(config);
    config.token_file = static_token_file();
  });
  for (const char* page : {"/", "/index.html", "/?scene=city"})
    EXPECT_THAT(http_get(guarded.port(), page).body,
                AllOf(Not(HasSubstr("og:")), Not(HasSubstr("city"))));
  for (const char* part : {"poster.jpg", "tours", "walk"})
    EXPECT_EQ(http_get(guarded.port(), std::string("/api/scenes/city/") + part).status, 401);
}

TEST(ServerAccess, ServesTlsWithTheGivenCertificate) {
  const TemporaryFolder folder;
  const auto certificate = folder / "certificate.pem";
  const auto key = folder / "key.pem";
  write_self_signed(certificate, key);
  {
    RunningServer server([&](ServerConfig& config) {
      config.tls_cert = certificate.string();
      config.tls_key = key.string();
    });
    const TlsReply reply = tls_get(server.port(), "/healthz");
    EXPECT_EQ(reply.protocol, "http/1.1");
    EXPECT_THAT(reply.text, StartsWith("HTTP/1.1 200"));
    // Without TLS it only says where the page is.
    const HttpReply plain = http_get(server.port(), "/?scene=city");
    EXPECT_EQ(plain.status, 308);
    EXPECT_EQ(plain.headers.at("location"),
              "https://127.0.0.1:" + std::to_string(server.port()) + "/?scene=city");
    EXPECT_EQ(http_put(server.port(), "/api/scenes/city/sidecar", "{}").status, 400);
    EXPECT_THAT(raw_answer(server.port(), handshake(server.port())), HasSubstr(" 400 "));
  }
  std::filesystem::remove(key);
  ServerConfig config = quiet_config();
  config.tls_cert = certificate.string();
  config.tls_key = key.string();
  EXPECT_THAT([&] { Server keyless(config); }, ThrowsMessage<InputError>(HasSubstr("--tls-key")));
}

TEST(ServerAccess, TakesARenewedCertificate) {
  const TemporaryFolder folder;
  const auto certificate = folder / "certificate.pem";
  const auto key = folder / "key.pem";
  write_self_signed(certificate, key, 1);
  RunningServer server([&](ServerConfig& config) {
    config.tls_cert = certificate.string();
    config.tls_key = key.string();
  });
  EXPECT_EQ(tls_get(server.port(), "/healthz").serial, 1);
  write_self_signed(certificate, folder / "other-key.pem", 2);  // not that of --tls-key
  std::this_thread::sleep_for(1500ms);
  EXPECT_EQ(tls_get(server.port(), "/healthz").serial, 1) << "half a pair changes nothing";
  write_self_signed(certificate, key, 3);
  EXPECT_TRUE(eventually([&] { return tls_get(server.port(), "/healthz").serial == 3; }));
}

}  // namespace
}  // namespace catgs::test
