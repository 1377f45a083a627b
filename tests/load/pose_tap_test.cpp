#include "tests/load/pose_tap.h"

#include <algorithm>

#include <gtest/gtest.h>

namespace catgs::load {
namespace {

std::vector<std::byte> bytes_of(const std::string& text) {
  std::vector<std::byte> bytes(text.size());
  std::ranges::transform(text, bytes.begin(), [](char c) { return static_cast<std::byte>(c); });
  return bytes;
}

const std::string upgrade =
    "GET /favicon HTTP/1.1\r\nHost: a\r\n\r\n"
    "GET / HTTP/1.1\r\nHost: a\r\nUpgrade: WebSocket\r\nConnection: Upgrade\r\n\r\n";

std::string pose_message(std::uint64_t id) {
  v1::ClientMessage message;
  message.mutable_pose()->set_pose_id(id);
  message.mutable_pose()->set_client_time_us(1'000'000 * static_cast<std::int64_t>(id));
  return message.SerializeAsString();
}

/// A masked WebSocket frame.
std::string frame(const std::string& payload, int opcode = 2, bool final = true) {
  std::string bytes;
  bytes += static_cast<char>((final ? 0x80 : 0) | opcode);
  if (payload.size() < 126) {
    bytes += static_cast<char>(0x80 | payload.size());
  } else {
    bytes += static_cast<char>(0x80 | 126);
    bytes += static_cast<char>(payload.size() >> 8);
    bytes += static_cast<char>(payload.size() & 0xff);
  }
  const std::string mask = "\x11\x22\x33\x44";
  bytes += mask;
  for (std::size_t i = 0; i < payload.size(); ++i) {
    bytes += static_cast<char>(payload[i] ^ mask[i % 4]);
  }
  return bytes;
}

/// Ids of the poses that the tap finds when the stream comes in pieces of this size.
std::vector<std::uint64_t> ids(const std::string& stream, std::size_t piece) {
  std::vector<std::uint64_t> found;
  PoseTap tap([&](const v1::PoseSample& sample) { found.push_back(sample.pose_id()); });
  const std::vector<std::byte> bytes = bytes_of(stream);
  for (std::size_t at = 0; at < bytes.size(); at += piece) {
    tap.read(std::span(bytes).subspan(at, std::min(piece, bytes.size() - at)));
  }
  return found;
}

TEST(PoseTap, FindsPosesHoweverTheBytesCome) {
  const std::string second = pose_message(2);
  v1::ClientMessage hello;
  hello.mutable_hello()->set_token(std::string(300, 'x'));  // a length of two bytes
  const std::string stream = upgrade + frame(hello.SerializeAsString()) + frame(pose_message(1)) +
                             frame("ping", 9) + frame(second.substr(0, 3), 2, false) +
                             frame("ping", 9) + frame(second.substr(3), 0) + frame(pose_message(3));
  for (const std::size_t piece : {std::size_t{1}, std::size_t{7}, std::size_t{100'000}}) {
    EXPECT_EQ(ids(stream, piece), (std::vector<std::uint64_t>{1, 2, 3})) << piece;
  }
}

TEST(PoseTap, LeavesAloneWhatItDoesNotUnderstand) {
  EXPECT_TRUE(ids("GET / HTTP/1.1\r\n\r\n" + frame(pose_message(1)), 10).empty()) << "no WebSocket";
  EXPECT_TRUE(ids(std::string(100'000, 'x'), 1000).empty());
  EXPECT_EQ(ids(upgrade + frame("\xff\xff\xff") + frame(pose_message(4)), 9),
            std::vector<std::uint64_t>{4});
  std::string unmasked = frame(pose_message(1));
  unmasked[1] = static_cast<char>(unmasked[1] & 0x7f);
  EXPECT_TRUE(ids(upgrade + unmasked + frame(pose_message(2)), 9).empty());
  const std::string endless = std::string("\x82\xff\x7f", 3) + std::string(300'000, 'x');
  EXPECT_TRUE(ids(upgrade + endless, 1000).empty());
}

}  // namespace
}  // namespace catgs::load
