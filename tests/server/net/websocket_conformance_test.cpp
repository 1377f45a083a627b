// RFC 6455 by the byte: what a client may do that ours does not, and what no client may do. Real
// sockets on loopback, a whole server in this process.

#include "tests/support/raw_socket.h"
#include "tests/support/server_client.h"
#include "tests/support/test.h"

namespace catgs::test {
namespace {

std::string hello() { return hello_message(64, 64, v1::CODEC_H264).SerializeAsString(); }

std::string close_payload(int code, std::string_view reason = {}) {
  std::string payload = {static_cast<char>(code >> 8), static_cast<char>(code)};
  return payload.append(reason);
}

class WebsocketConformance : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    server =
        std::make_unique<RunningServer>([](ServerConfig& config) { config.max_sessions = 64; });
  }
  static void TearDownTestSuite() { server.reset(); }

  /// Whatever was done to it, the server goes on with others.
  void TearDown() override {
    WireClient good(server->port());
    good.greet();
    good.send_pose(1);
    EXPECT_FALSE(good.receive_frame().bitstream.empty());
  }

  static RawSocket open() {
    RawSocket socket(server->port());
    socket.send(handshake(server->port()));
    std::string reply;
    EXPECT_TRUE(socket.receive_until("\r\n\r\n", reply));
    EXPECT_THAT(reply, StartsWith("HTTP/1.1 101"));
    EXPECT_THAT(reply, HasSubstr("s3pPLMBiTxaQ9kYGzzhZRbK+xOo="));  // RFC 6455, 1.3
    return socket;
  }
  /// The welcome names the scene.
  static bool welcomed(RawSocket& socket) {
    std::string received;
    return socket.receive_until("city", received);
  }
  /// The connection ends because of `bytes`; the code of the server's close frame, 0 without one.
  static int code_after(const std::string& bytes) {
    RawSocket socket = open();
    socket.send(bytes);
    std::string received;
    const bool framed = socket.receive_until("\x88", received);
    EXPECT_TRUE(framed || socket.closed_within(5s)) << "still open";
    const std::size_t at = received.find('\x88');
    if (at == std::string::npos || at + 4 > received.size() || received[at + 1] < 2) return 0;
    return static_cast<unsigned char>(received[at + 2]) << 8 |
           static_cast<unsigned char>(received[at + 3]);
  }

  static std::unique_ptr<RunningServer> server;
};

std::unique_ptr<RunningServer> WebsocketConformance::server;

TEST_F(WebsocketConformance, AMessageMayComeInFragmentsAndBytes) {
  RawSocket fragments = open();
  const std::string message = hello();
  fragments.send(client_frame(ws_binary, message.substr(0, 3)));
  fragments.send(client_frame(ws_continuation, ""));
  fragments.send(client_frame(ws_fin | ws_ping, "between"));
  fragments.send(client_frame(ws_continuation, message.substr(3, 1)));
  fragments.send(client_frame(ws_fin | ws_continuation, message.substr(4)));
  std::string received;
  EXPECT_TRUE(fragments.receive_until("between", received));
  EXPECT_TRUE(received.find("city") != std::string::npos || welcomed(fragments));

  RawSocket bytes = open();
  for (const char byte : client_frame(ws_fin | ws_binary, message)) bytes.send({&byte, 1});
  EXPECT_TRUE(welcomed(bytes));
}

TEST_F(WebsocketConformance, PingsAreAnsweredWithTheirPayload) {
  RawSocket socket = open();
  const std::string payload(125, 'p');
  socket.send(client_frame(ws_fin | ws_pong, "nobody asked"));
  socket.send(client_frame(ws_fin | ws_ping, payload));
  std::string received;
  EXPECT_TRUE(socket.receive_until(payload, received));
  EXPECT_THAT(received, HasSubstr("\x8a\x7d" + payload));
  socket.send(client_frame(ws_fin | ws_ping, ""));
  received.clear();
  EXPECT_TRUE(socket.receive_until(std::string("\x8a\0", 2), received));
}

TEST_F(WebsocketConformance, ControlFramesAreShortAndWhole) {
  EXPECT_THAT(code_after(client_frame(ws_fin | ws_ping, std::string(126, 'p'))), AnyOf(0, 1002));
  EXPECT_THAT(code_after(client_frame(ws_ping, "half")), AnyOf(0, 1002));
  EXPECT_THAT(code_after(client_frame(ws_fin | ws_close, std::string(200, 'c'))), AnyOf(0, 1002));
}

TEST_F(WebsocketConformance, ReservedBitsAndOpcodesEndTheConnection) {
  for (const int first : {0xc2, 0xa2, 0x92, 0x83, 0x87, 0x8b, 0x8f})
    EXPECT_THAT(code_after(client_frame(static_cast<std::uint8_t>(first), hello())), AnyOf(0, 1002))
        << std::hex << first;
}

TEST_F(WebsocketConformance, FragmentsKeepTheirOrder) {
  EXPECT_THAT(code_after(client_frame(ws_fin | ws_continuation, hello())), AnyOf(0, 1002));
  EXPECT_THAT(code_after(client_frame(ws_binary, "a") + client_frame(ws_fin | ws_binary, hello())),
              AnyOf(0, 1002));
}

// RFC 6455, 5.1, wants them refused, to protect proxies from what scripts of a page may send;
// libwebsockets reads them, and nothing of the server depends on it: what is in them is checked
// like the rest.
TEST_F(WebsocketConformance, UnmaskedFramesAreCheckedLikeOthers) {
  EXPECT_EQ(code_after(std::string("\x82\x05hello", 7)), 1008);
}

TEST_F(WebsocketConformance, TextIsRefusedWhateverIsInIt) {
  EXPECT_EQ(code_after(client_frame(ws_fin | ws_text, "hello")), 1003);
  EXPECT_THAT(code_after(client_frame(ws_fin | ws_text, "\xc3\x28")), AnyOf(1003, 1007));
  EXPECT_THAT(code_after(client_frame(ws_text, "\xed\xa0")), AnyOf(1003, 1007));
}

TEST_F(WebsocketConformance, OversizedMessagesAreRefusedBeforeTheyArrive) {
  EXPECT_EQ(code_after(client_frame(ws_fin | ws_binary, std::string(64 * 1024 + 1, 'x'))), 1009);
  std::string fragments = client_frame(ws_binary, std::string(40'000, 'x'));
  fragments += client_frame(ws_fin | ws_continuation, std::string(40'000, 'x'));
  EXPECT_EQ(code_after(fragments), 1009);
  // Lengths that only begin to arrive; the highest bit must be 0 (5.2).
  const std::string mask = "\x12\x34\x56\x78";
  EXPECT_EQ(code_after("\x82\xff" + std::string("\0\0\0\x7f\0\0\0\0", 8) + mask +
                       std::string(70'000, 'x')),
            1009);
  EXPECT_THAT(code_after("\x82\xff" + std::string(8, '\xff') + mask + std::string(70'000, 'x')),
              AnyOf(0, 1002, 1009));
}

TEST_F(WebsocketConformance, ClosingIsAnsweredWhateverTheCode) {
  EXPECT_EQ(code_after(client_frame(ws_fin | ws_close, close_payload(1000, "bye"))), 1000);
  for (const std::string& payload :
       {std::string(), std::string("\x03"), close_payload(0), close_payload(999),
        close_payload(1005), close_payload(5000), close_payload(1000, "\xc3\x28")})
    code_after(client_frame(ws_fin | ws_close, payload));
}

TEST_F(WebsocketConformance, NothingIsHeardAfterTheCloseFrame) {
  RawSocket socket = open();
  socket.send(client_frame(ws_fin | ws_close, close_payload(1000)) +
              client_frame(ws_fin | ws_binary, hello()));
  std::string received;
  EXPECT_FALSE(socket.receive_until("city", received));
}

TEST_F(WebsocketConformance, NothingIsSaidBehindTheCloseFrame) {
  RawSocket socket = open();
  socket.send(client_frame(ws_fin | ws_binary, hello()));
  EXPECT_TRUE(welcomed(socket));
  socket.send(client_frame(0xc2, hello()));
  std::string received;
  socket.receive_until("nothing that is said", received);  // until it is closed
  const std::size_t code = received.find("\x03\xea");      // 1002
  ASSERT_NE(code, std::string::npos);
  ASSERT_GE(code, 2u);
  ASSERT_EQ(received[code - 2], '\x88');
  EXPECT_EQ(received.size(), code + static_cast<std::size_t>(received[code - 1]));
}

/// libwebsockets says nothing of most of these.
TEST_F(WebsocketConformance, FloodsOfEmptyFramesEndTheConnection) {
  const std::string head = client_frame(ws_binary, "");
  for (const auto& [first, frame] :
       {std::pair{std::string(), client_frame(ws_fin | ws_ping, "")},
        {std::string(), client_frame(ws_fin | ws_ping, std::string(125, 'p'))},
        {std::string(), client_frame(ws_fin | ws_pong, "")},
        {std::string(), client_frame(ws_fin | ws_pong, "pong")},
        {std::string(), std::string("\x8a\0", 2)},  // without a mask
        {head, client_frame(ws_continuation, "")}}) {
    RawSocket socket = open();
    socket.send(first);
    std::string flood;
    while (flood.size() < (64u << 10)) flood += frame;
    for (int i = 0; i < 64 && socket.send(flood); ++i) {
    }
    std::string received;
    EXPECT_TRUE(socket.receive_until("too many messages", received));
    EXPECT_TRUE(socket.receive_until("\x88\x13\x03\xf0too many messages", received));
  }
}

TEST_F(WebsocketConformance, AFloodThatContinuesAfterTheCloseFrameIsCutOff) {
  RawSocket socket = open();
  std::string flood;
  while (flood.size() < (1u << 20)) flood += client_frame(ws_fin | ws_pong, "");
  int sent = 0;
  while (sent < 1000 && socket.send(flood)) ++sent;
  EXPECT_LT(sent, 1000);
}

TEST_F(WebsocketConformance, HandshakesWithoutTheirPartsAreRefused) {
  const auto refused = [](const std::string& from, const std::string& to) {
    std::string request = handshake(server->port());
    request.replace(request.find(from), from.size(), to);
    return raw_answer(server->port(), request).find(" 101 ") == std::string::npos;
  };
  EXPECT_TRUE(refused("Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n", ""));
  EXPECT_TRUE(refused("Sec-WebSocket-Version: 13", "Sec-WebSocket-Version: 7"));
  EXPECT_TRUE(refused("catgs.v1", "catgs.v9"));
  EXPECT_TRUE(refused("GET /", "POST /"));
  EXPECT_TRUE(refused("Connection: Upgrade\r\n", ""));
  EXPECT_TRUE(refused("Host: 127.0.0.1", "Host: evil.example"));
  EXPECT_FALSE(refused("Upgrade: websocket", "upgrade: WebSocket"));
}

}  // namespace
}  // namespace catgs::test
