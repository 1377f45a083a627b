#include "server/pipeline/packet_ring.h"

#include "server/pipeline/latest_slot.h"
#include "tests/support/test.h"

namespace catgs {
namespace {

OutgoingFrame frame(std::uint64_t id, bool idr, std::size_t bytes = 10) {
  OutgoingFrame out;
  out.ticket.frame_id = id;
  out.ticket.idr = idr;
  out.bitstream.resize(bytes);
  return out;
}

OutgoingMessage message(int value, Topic topic = Topic::event, std::size_t bytes = 1) {
  return {topic, std::vector<std::byte>(bytes, static_cast<std::byte>(value))};
}

/// Of a packet that waits: the value of a message, or 100 and the number of a frame.
int popped(PacketRing& ring) {
  const auto packet = ring.pop();
  if (!packet) return -1;
  return packet->frame ? 100 + static_cast<int>(packet->frame->frame_id)
                       : std::to_integer<int>(packet->bytes.at(0));
}

std::vector<int> all_popped(PacketRing& ring) {
  std::vector<int> all;
  while (!ring.empty()) all.push_back(popped(ring));
  return all;
}

TEST(PacketRing, KeepsOrder) {
  PacketRing ring;
  EXPECT_TRUE(ring.push(message(1)));
  EXPECT_THAT(ring.push(frame(1, true)), IsEmpty());
  EXPECT_TRUE(ring.push(message(2)));
  EXPECT_THAT(all_popped(ring), ElementsAre(1, 101, 2));
  EXPECT_FALSE(ring.pop());
}

TEST(PacketRing, OverflowDropsToTheNextIdr) {
  PacketRing ring({.frames = 2, .frame_bytes = 1000, .messages = 4});
  EXPECT_THAT(ring.push(frame(1, true)), IsEmpty());
  EXPECT_THAT(ring.push(frame(2, false)), IsEmpty());
  EXPECT_TRUE(ring.push(message(7)));
  EXPECT_THAT(ring.push(frame(3, false)), ElementsAre(1, 2, 3));
  EXPECT_THAT(ring.push(frame(4, false)), ElementsAre(4)) << "undecodable without the dropped ones";
  EXPECT_THAT(ring.push(frame(5, true)), IsEmpty());
  EXPECT_THAT(ring.push(frame(6, false)), IsEmpty());
  EXPECT_THAT(all_popped(ring), ElementsAre(7, 105, 106)) << "messages survive";
  EXPECT_EQ(ring.frame_bytes(), 0u);
}

TEST(PacketRing, AnIdrReplacesAFullRing) {
  PacketRing ring({.frames = 1, .frame_bytes = 1000, .messages = 4});
  EXPECT_THAT(ring.push(frame(1, true)), IsEmpty());
  EXPECT_THAT(ring.push(frame(2, true)), ElementsAre(1));
  EXPECT_EQ(ring.pop()->frame->frame_id, 2u);
}

TEST(PacketRing, BoundsBytesButTakesOneFrameOfAnySize) {
  PacketRing ring({.frames = 8, .frame_bytes = 100, .messages = 4});
  EXPECT_THAT(ring.push(frame(1, true, 500)), IsEmpty());
  EXPECT_THAT(ring.push(frame(2, false, 1)), ElementsAre(1, 2));
}

TEST(PacketRing, RefusesTooManyMessages) {
  PacketRing ring({.frames = 8, .frame_bytes = 100, .messages = 2});
  EXPECT_TRUE(ring.push(message(1)));
  EXPECT_TRUE(ring.push(message(2)));
  EXPECT_FALSE(ring.push(message(3)));
  ring.pop();
  EXPECT_TRUE(ring.push(message(4)));
}

TEST(PacketRing, BoundsBytesOfMessagesButTakesOneOfAnySize) {
  PacketRing ring({.frames = 8, .frame_bytes = 10, .messages = 4, .message_bytes = 100});
  EXPECT_TRUE(ring.push(message(1, Topic::event, 500)));
  EXPECT_FALSE(ring.push(message(2)));
  ring.pop();
  EXPECT_TRUE(ring.push(message(3, Topic::event, 60)));
  EXPECT_TRUE(ring.push(message(4, Topic::event, 40)));
  EXPECT_FALSE(ring.push(message(5)));
  EXPECT_EQ(popped(ring), 3);
  EXPECT_THAT(ring.push(frame(1, true, 10)), IsEmpty()) << "frames have bytes of their own";
  EXPECT_TRUE(ring.push(message(6, Topic::event, 60)));
}

/// Of welcomes of a megabyte each that nobody reads one waits.
TEST(PacketRing, ANewerMessageReplacesOneThatWaits) {
  PacketRing ring({.frames = 8, .frame_bytes = 10, .messages = 4, .message_bytes = 100});
  for (int i = 0; i < 1000; ++i) EXPECT_TRUE(ring.push(message(i % 50, Topic::session, 90)));
  EXPECT_TRUE(ring.push(message(51, Topic::clock)));
  EXPECT_TRUE(ring.push(message(52)));
  EXPECT_TRUE(ring.push(message(53, Topic::clock)));
  EXPECT_TRUE(ring.push(message(54)));
  EXPECT_THAT(all_popped(ring), ElementsAre(49, 52, 53, 54)) << "events stay, all others move up";
}

TEST(PacketRing, AWelcomeReplacesTheConfigurationBeforeIt) {
  PacketRing ring;
  EXPECT_TRUE(ring.push(message(1, Topic::session)));
  EXPECT_TRUE(ring.push(message(2, Topic::stream)));
  EXPECT_TRUE(ring.push(message(3, Topic::stream)));
  EXPECT_THAT(all_popped(ring), ElementsAre(1, 3));
  EXPECT_TRUE(ring.push(message(1, Topic::session)));
  EXPECT_TRUE(ring.push(message(2, Topic::stream)));
  EXPECT_TRUE(ring.push(message(3, Topic::session)));
  EXPECT_THAT(all_popped(ring), ElementsAre(3));
}

TEST(PacketRing, NothingIsReplacedThatAFrameStandsBehind) {
  PacketRing ring;
  EXPECT_TRUE(ring.push(message(1, Topic::stream)));
  EXPECT_THAT(ring.push(frame(1, true)), IsEmpty());
  EXPECT_TRUE(ring.push(message(2, Topic::stream)));
  EXPECT_TRUE(ring.push(message(3, Topic::stream)));
  EXPECT_THAT(ring.push(frame(2, true)), IsEmpty());
  EXPECT_THAT(all_popped(ring), ElementsAre(1, 101, 3, 102));
}

TEST(PacketRing, IsBoundedInFramesBytesAndMessages) {
  PacketRing ring;
  for (std::uint64_t id = 1; id <= 8; ++id) EXPECT_THAT(ring.push(frame(id, id == 1)), IsEmpty());
  EXPECT_THAT(ring.push(frame(9, false)), SizeIs(9));
  for (int i = 0; i < 64; ++i) EXPECT_TRUE(ring.push(message(i)));
  EXPECT_FALSE(ring.push(message(64)));
  PacketRing long_messages;
  EXPECT_TRUE(long_messages.push(message(1, Topic::event, 3 << 20)));
  EXPECT_TRUE(long_messages.push(message(2, Topic::event, 1 << 20)));
  EXPECT_FALSE(long_messages.push(message(3)));
  PacketRing large;
  EXPECT_THAT(large.push(frame(1, true, 5 << 20)), IsEmpty());
  EXPECT_THAT(large.push(frame(2, false, 3 << 20)), IsEmpty());
  EXPECT_THAT(large.push(frame(3, false, 1)), ElementsAre(1, 2, 3));
}

TEST(LatestSlot, TheNewestWins) {
  LatestSlot<int> slot;
  EXPECT_FALSE(slot.take());
  EXPECT_TRUE(slot.store(1));
  EXPECT_FALSE(slot.store(2));
  EXPECT_EQ(slot.take(), 2);
  EXPECT_TRUE(slot.store(3));
}

}  // namespace
}  // namespace catgs
