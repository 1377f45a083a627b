#include "server/pipeline/packet_ring.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/pipeline/latest_slot.h"

namespace catgs {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

OutgoingFrame frame(std::uint64_t id, bool idr, std::size_t bytes = 10) {
  OutgoingFrame out;
  out.ticket.frame_id = id;
  out.ticket.idr = idr;
  out.bitstream.resize(bytes);
  return out;
}

std::vector<std::byte> message(int value) { return {static_cast<std::byte>(value)}; }

TEST(PacketRing, KeepsOrder) {
  PacketRing ring;
  EXPECT_TRUE(ring.push(message(1)));
  EXPECT_THAT(ring.push(frame(1, true)), IsEmpty());
  EXPECT_TRUE(ring.push(message(2)));
  EXPECT_EQ(ring.pop()->bytes, message(1));
  EXPECT_EQ(ring.pop()->frame->frame_id, 1u);
  EXPECT_EQ(ring.pop()->bytes, message(2));
  EXPECT_FALSE(ring.pop());
}

TEST(PacketRing, OverflowDropsToTheNextIdrAndCounts) {
  PacketRing ring({.frames = 2, .frame_bytes = 1000, .messages = 4});
  EXPECT_THAT(ring.push(frame(1, true)), IsEmpty());
  EXPECT_THAT(ring.push(frame(2, false)), IsEmpty());
  EXPECT_TRUE(ring.push(message(7)));
  EXPECT_THAT(ring.push(frame(3, false)), ElementsAre(1, 2, 3));
  EXPECT_THAT(ring.push(frame(4, false)), ElementsAre(4)) << "undecodable without the dropped ones";
  EXPECT_THAT(ring.push(frame(5, true)), IsEmpty());
  EXPECT_THAT(ring.push(frame(6, false)), IsEmpty());
  EXPECT_EQ(ring.dropped_frames(), 4u);
  EXPECT_EQ(ring.pop()->bytes, message(7)) << "messages survive";
  EXPECT_EQ(ring.pop()->frame->frame_id, 5u);
  EXPECT_EQ(ring.pop()->frame->frame_id, 6u);
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

TEST(PacketRing, ForASocketIsBoundedInFramesBytesAndMessages) {
  PacketRing ring;
  for (std::uint64_t id = 1; id <= 8; ++id) EXPECT_THAT(ring.push(frame(id, id == 1)), IsEmpty());
  EXPECT_THAT(ring.push(frame(9, false)), testing::SizeIs(9));
  for (int i = 0; i < 64; ++i) EXPECT_TRUE(ring.push(message(i)));
  EXPECT_FALSE(ring.push(message(64)));
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
