#include "tests/load/pose_tap.h"

#include "tests/support/raw_socket.h"
#include "tests/support/server_client.h"
#include "tests/support/test.h"

namespace catgs::load {
namespace {

const std::string upgrade =
    "GET /favicon HTTP/1.1\r\nHost: a\r\n\r\n"
    "GET / HTTP/1.1\r\nHost: a\r\nUpgrade: WebSocket\r\nConnection: Upgrade\r\n\r\n";

std::string pose(std::uint64_t id) { return test::pose_message(id, 0.0f).SerializeAsString(); }

std::string frame(const std::string& payload, int opcode = test::ws_binary, bool final = true) {
  return test::client_frame(static_cast<std::uint8_t>((final ? test::ws_fin : 0) | opcode),
                            payload);
}

/// Ids of the poses that the tap finds when the stream comes in pieces of this size.
std::vector<std::uint64_t> ids(const std::string& stream, std::size_t piece) {
  std::vector<std::uint64_t> found;
  PoseTap tap([&](const v1::PoseSample& sample) { found.push_back(sample.pose_id()); });
  for (std::size_t at = 0; at < stream.size(); at += piece)
    tap.read(std::as_bytes(std::span(stream).subspan(at, std::min(piece, stream.size() - at))));
  return found;
}

TEST(PoseTap, FindsPosesHoweverTheBytesCome) {
  const std::string second = pose(2);
  v1::ClientMessage hello;
  hello.mutable_hello()->set_token(std::string(300, 'x'));  // a length of two bytes
  const std::string stream =
      upgrade + frame(hello.SerializeAsString()) + frame(pose(1)) + frame("ping", test::ws_ping) +
      frame(second.substr(0, 3), test::ws_binary, false) + frame("ping", test::ws_ping) +
      frame(second.substr(3), test::ws_continuation) + frame(pose(3));
  for (const std::size_t piece : {std::size_t{1}, std::size_t{7}, std::size_t{100'000}}) {
    EXPECT_EQ(ids(stream, piece), (std::vector<std::uint64_t>{1, 2, 3})) << piece;
  }
}

TEST(PoseTap, LeavesAloneWhatItDoesNotUnderstand) {
  EXPECT_TRUE(ids("GET / HTTP/1.1\r\n\r\n" + frame(pose(1)), 10).empty()) << "no WebSocket";
  EXPECT_TRUE(ids(std::string(100'000, 'x'), 1000).empty());
  EXPECT_EQ(ids(upgrade + frame("\xff\xff\xff") + frame(pose(4)), 9),
            std::vector<std::uint64_t>{4});
  std::string unmasked = frame(pose(1));
  unmasked[1] = static_cast<char>(unmasked[1] & 0x7f);
  EXPECT_TRUE(ids(upgrade + unmasked + frame(pose(2)), 9).empty());
  const std::string endless = std::string("\x82\xff\x7f", 3) + std::string(300'000, 'x');
  EXPECT_TRUE(ids(upgrade + endless, 1000).empty());
}

}  // namespace
}  // namespace catgs::load
