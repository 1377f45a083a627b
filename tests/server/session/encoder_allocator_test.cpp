#include "server/session/encoder_allocator.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace catgs {
namespace {

using namespace std::chrono_literals;
using testing::Contains;
using testing::Pair;

const EncoderChoice nvenc{EncoderKind::nvenc, Codec::h264, "h264_nvenc"};
const EncoderChoice x264{EncoderKind::x264, Codec::h264, "libx264"};
const EncoderChoice jpeg{EncoderKind::jpeg, Codec::mjpeg, "mjpeg"};
const std::vector<Codec> both = {Codec::h264, Codec::mjpeg};

class EncoderAllocatorTest : public testing::Test {
 protected:
  using Grants = std::vector<EncoderAllocator::Grant>;
  /// Grants as many as there are, at most so many.
  Grants take(const EncoderAllocator& from, int count) const {
    Grants grants;
    for (int i = 0; i < count; ++i) {
      auto grant = from.grant(both, now);
      if (!grant) break;
      grants.push_back(*std::move(grant));
    }
    return grants;
  }
  static int count(const Grants& grants, EncoderKind kind) {
    return static_cast<int>(std::ranges::count_if(
        grants, [&](const auto& grant) { return grant.encoder.kind == kind; }));
  }
  TimePoint now = TimePoint{} + 1h;
};

TEST_F(EncoderAllocatorTest, GivesTheBestThatTheClientDecodes) {
  const EncoderAllocator allocator({nvenc, x264, jpeg}, {});
  EXPECT_EQ(allocator.grant(both, now)->encoder.kind, EncoderKind::nvenc);
  EXPECT_EQ(allocator.grant(std::vector{Codec::mjpeg}, now)->encoder.kind, EncoderKind::jpeg);
  EXPECT_FALSE(allocator.grant({}, now));
  EXPECT_FALSE(allocator.serves({}));
  EXPECT_FALSE(EncoderAllocator({x264}, {}).serves(std::vector{Codec::mjpeg}));
}

TEST_F(EncoderAllocatorTest, WhoFindsNvencTakenGetsX264) {
  const EncoderAllocator allocator({nvenc, x264, jpeg}, {.nvenc_sessions = 2});
  Grants grants = take(allocator, 5);
  EXPECT_EQ(count(grants, EncoderKind::nvenc), 2);
  EXPECT_EQ(count(grants, EncoderKind::x264), 3);
  EXPECT_THAT(allocator.in_use(), Contains(Pair("h264_nvenc", 2)));
  EXPECT_THAT(allocator.in_use(), Contains(Pair("libx264", 3)));
  EXPECT_THAT(allocator.in_use(), Contains(Pair("mjpeg", 0)));
  grants.erase(grants.begin());
  EXPECT_EQ(allocator.grant(both, now)->encoder.kind, EncoderKind::nvenc) << "one was given back";
}

TEST_F(EncoderAllocatorTest, OrWaitsForOne) {
  const EncoderAllocator allocator({nvenc, x264}, {.nvenc_sessions = 2, .queue_for_nvenc = true});
  Grants grants = take(allocator, 5);
  EXPECT_EQ(grants.size(), 2u);
  grants.clear();
  EXPECT_TRUE(allocator.grant(both, now));
}

TEST_F(EncoderAllocatorTest, WaitsWhereOnlyAWorseCodecIsFree) {
  const EncoderAllocator allocator({nvenc, jpeg}, {.nvenc_sessions = 1});
  EXPECT_EQ(take(allocator, 3).size(), 1u);
}

TEST_F(EncoderAllocatorTest, LearnsTheLimitFromRefusalsAndTriesAgainAfterAMinute) {
  const EncoderAllocator allocator({nvenc, x264}, {});
  Grants open = take(allocator, 3);
  EXPECT_EQ(count(open, EncoderKind::nvenc), 3) << "nothing is known";
  const auto other = allocator.replace_refused(open.back(), both, now);  // the driver has two
  ASSERT_TRUE(other);
  EXPECT_EQ(other->encoder.kind, EncoderKind::x264);
  open.pop_back();
  EXPECT_EQ(allocator.grant(both, now)->encoder.kind, EncoderKind::x264) << "without asking again";
  now += 61s;
  EXPECT_EQ(allocator.grant(both, now)->encoder.kind, EncoderKind::nvenc)
      << "another program may have left";
}

TEST_F(EncoderAllocatorTest, ARefusalOfOneSoftwareEncoderIsNoMatterOfSeats) {
  const EncoderAllocator allocator({x264, jpeg}, {});
  const auto grant = allocator.grant(both, now);
  EXPECT_FALSE(allocator.replace_refused(*grant, both, now));
  EXPECT_FALSE(allocator.replace_failed(*grant, both, now));
}

TEST_F(EncoderAllocatorTest, AnNvencThatFailedIsNoMatterOfSeatsEither) {
  const EncoderAllocator allocator({nvenc, x264}, {});
  const Grants open = take(allocator, 2);
  const auto other = allocator.replace_failed(open.back(), both, now);
  ASSERT_TRUE(other);
  EXPECT_EQ(other->encoder.kind, EncoderKind::x264);
  EXPECT_EQ(count(take(allocator, 3), EncoderKind::nvenc), 3) << "no limit is learnt";
  EXPECT_FALSE(EncoderAllocator({nvenc, jpeg}, {}).replace_failed(open.back(), both, now))
      << "a worse codec is no way out: it is opened anew";
}

TEST_F(EncoderAllocatorTest, WhoComesBackKeepsWhatItHad) {
  const EncoderAllocator allocator({nvenc, x264, jpeg}, {.nvenc_sessions = 1});
  const auto first = allocator.grant(both, now);
  EXPECT_EQ(allocator.renew(*first, both, now)->seat, first->seat) << "though all are taken";
  const auto without_video = allocator.renew(*first, std::vector{Codec::mjpeg}, now);
  EXPECT_EQ(without_video->encoder.kind, EncoderKind::jpeg) << "its page decodes nothing else now";
}

TEST_F(EncoderAllocatorTest, ASeatOutlivesItsAllocator) {
  auto allocator =
      std::make_unique<EncoderAllocator>(std::vector{nvenc}, EncoderAllocator::Policy{});
  const auto grant = allocator->grant(both, now);
  allocator.reset();
  EXPECT_EQ(grant->seat->kind(), EncoderKind::nvenc);
}

}  // namespace
}  // namespace catgs
