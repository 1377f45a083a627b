#include "tests/load/link.h"

#include <fmt/format.h>

#include "render_core/base/error.h"
#include "tests/load/units.h"
#include "tests/support/test.h"

namespace catgs::load {
namespace {

constexpr std::size_t segment = LinkShaper::segment_bytes;

TEST(Units, TakeWhatPeopleWrite) {
  EXPECT_DOUBLE_EQ(parse_duration_s("", "500ms"), 0.5);
  EXPECT_DOUBLE_EQ(parse_duration_s("", "2m"), 120.0);
  EXPECT_DOUBLE_EQ(parse_duration_s("", "7"), 7.0);
  EXPECT_DOUBLE_EQ(parse_bits_per_s("", "1.5mbit"), 1.5e6);
  EXPECT_DOUBLE_EQ(parse_bits_per_s("", "0"), 0.0);
  EXPECT_DOUBLE_EQ(parse_share("", "2.5%"), 0.025);
  EXPECT_DOUBLE_EQ(parse_share("", "0.01"), 0.01);
  for (const char* bad : {"", "5 s", "s", "-1s", "1d", "nan", "inf", "5ss"})
    EXPECT_THROW(parse_duration_s("--x", bad), InputError) << bad;
  for (const char* bad : {"", "5", "5mb", "-1mbit"})
    EXPECT_THROW(parse_bits_per_s("--x", bad), InputError) << bad;
  for (const char* bad : {"", "101%", "2", "-1%"})
    EXPECT_THROW(parse_share("--x", bad), InputError) << bad;
}

TEST(Link, ParsesItsParts) {
  const LinkSettings link = parse_link(
      "--link",
      "rate=50mbit@0s,5mbit@10s,0@20s,up=2mbit,delay=20ms,jitter=5ms,loss=1%,burst=4,queue=1s");
  ASSERT_EQ(link.down.size(), 3u);
  EXPECT_EQ(link.down[1].from_us, 10'000'000);
  EXPECT_EQ(link.down[1].bits_per_s, 5e6);
  EXPECT_EQ(link.down[2].bits_per_s, 0.0);
  ASSERT_EQ(link.up.size(), 1u);
  EXPECT_EQ(link.up[0].bits_per_s, 2e6);
  EXPECT_EQ(link.delay_us, 20'000);
  EXPECT_EQ(link.jitter_us, 5'000);
  EXPECT_EQ(link.loss, 0.01);
  EXPECT_EQ(link.burst, 4.0);
  EXPECT_EQ(link.queue_us, 1'000'000);
  EXPECT_TRUE(link.cubic);
  EXPECT_FALSE(parse_link("--link", "delay=1ms,congestion=none").cubic);
  EXPECT_TRUE(link.shapes());
  EXPECT_FALSE(parse_link("--link", "").shapes());
  EXPECT_EQ(parse_link("--link", "rate=5mbit").up.at(0).bits_per_s, 5e6);
}

TEST(Link, MobileRatesVaryAroundTheirMedianAndRepeat) {
  const RateSchedule rates = parse_link("--link", "rate=4g:7,delay=25ms").down;
  ASSERT_EQ(rates.size(), 1200u);
  EXPECT_EQ(rates[1].from_us, 500'000);
  std::vector<double> mbit;
  for (const RateStep& step : rates) mbit.push_back(1e-6 * step.bits_per_s);
  std::ranges::sort(mbit);
  EXPECT_EQ(mbit.front(), 0.5) << "handovers";
  EXPECT_GT(mbit[60], 0.5) << "in less than 5 % of the time";
  EXPECT_NEAR(mbit[600], 12.0, 5.0);
  EXPECT_LE(mbit.back(), 80.0);
  const auto step_us = [](std::uint64_t seed) { return mobile_rates(seed)[3].bits_per_s; };
  EXPECT_EQ(step_us(7), rates[3].bits_per_s);
  EXPECT_NE(step_us(8), rates[3].bits_per_s);
}

TEST(Link, RefusesWhatIsNone) {
  for (const char* bad : {"5mbit", "rate", "rate=", "rate=5", "rate=5mbit@3s", "speed=5mbit",
                          "rate=5mbit@0s,1mbit@0s", "delay=20m,jitter=-1ms", "loss=60%", "burst=0",
                          "rate=5mbit,,", "rate=4g:", "rate=4g:x", "rate=1mbit,4g:1",
                          "congestion=vegas", "rate=5mbit,1mbit@2s,1mbit@1s"}) {
    EXPECT_THROW(parse_link("--link", bad), InputError) << bad;
  }
  EXPECT_THAT([] { parse_link("--link", "speed=1mbit"); },
              ThrowsMessage<InputError>(HasSubstr("speed")));
}

/// A path whose sender may have any amount under way.
LinkShaper shaper(std::string_view text) {
  LinkSettings link = parse_link("", text);
  link.cubic = false;
  return {link, link.down, 7};
}

TEST(LinkShaper, NothingIsLateWithoutLimits) {
  LinkShaper link = shaper("");
  EXPECT_EQ(link.send(1'000'000, 5), 5);
  EXPECT_EQ(link.room_bytes(5), SIZE_MAX);
}

TEST(LinkShaper, DelaysAndSerialises) {
  LinkShaper link = shaper("rate=8mbit,delay=10ms");  // a byte a microsecond
  EXPECT_EQ(link.send(1000, 0), 11'000);
  EXPECT_EQ(link.send(1000, 0), 12'000) << "behind the first";
  EXPECT_EQ(link.send(1000, 50'000), 61'000) << "the link was idle meanwhile";
}

TEST(LinkShaper, CarriesBytesAcrossStepsOfItsRate) {
  LinkShaper link = shaper("rate=8mbit@0s,800kbit@1s,0@2s,8mbit@3s");
  // 500 bytes before the step, 500 at a tenth of the rate behind it.
  EXPECT_EQ(link.send(1000, 999'500), 1'005'000);
  // 100 bytes until the outage, and 900 after it.
  EXPECT_EQ(link.send(1000, 1'999'000), 3'000'900);
}

TEST(LinkShaper, AnOutageWithoutAnEndHasNone) {
  LinkShaper link = shaper("rate=8mbit@0s,0@1s");
  EXPECT_GE(link.send(1000, 1'500'000), LinkShaper::never_us);
  EXPECT_GE(link.next_room_us(), LinkShaper::never_us);
}

TEST(LinkShaper, TheBottleneckBuffersSoMuchAndNoMore) {
  LinkShaper link = shaper("rate=8mbit,queue=100ms");
  EXPECT_EQ(link.room_bytes(0), 100'000u);
  link.send(60'000, 0);
  link.send(40'000, 0);
  EXPECT_EQ(link.room_bytes(0), 0u);
  EXPECT_EQ(link.next_room_us(), 60'000);
  EXPECT_EQ(link.room_bytes(60'000), 60'000u);
  EXPECT_EQ(link.room_bytes(100'000), 100'000u);
}

TEST(LinkShaper, KeepsTheOrderUnderJitterAndLoss) {
  LinkShaper link = shaper("rate=80mbit,delay=20ms,jitter=30ms,loss=10%,burst=3");
  std::int64_t last = 0;
  for (std::int64_t now = 0; now < 2'000'000; now += 1000) {
    const std::int64_t arrival = link.send(segment, now);
    EXPECT_GE(arrival, last);
    EXPECT_GE(arrival, now + 20'000);
    last = arrival;
  }
}

/// Share of segments that came later than the delay: lost ones, and those that waited for them.
double late_share(std::string_view text, std::int64_t interval_us) {
  LinkShaper link = shaper(text);
  int late = 0;
  constexpr int segments = 200'000;
  for (int i = 0; i < segments; ++i)
    late += link.send(segment, i * interval_us) > i * interval_us + 1000;
  return static_cast<double>(late) / segments;
}

TEST(LinkShaper, LosesTheShareThatItShould) {
  // So far apart that nothing waits for another: a lost one takes 2 ms more.
  EXPECT_NEAR(late_share("delay=1ms,loss=2%", 10'000), 0.02, 0.002);
  // Runs of five on average have the same share; none of it is late that was not lost.
  EXPECT_NEAR(late_share("delay=1ms,loss=2%,burst=5", 1'000'000), 0.02, 0.004);
}

TEST(LinkShaper, DataBehindALossWaitsForIt) {
  LinkShaper link = shaper("delay=10ms,loss=50%,burst=1000");
  std::int64_t longest = 0;
  for (std::int64_t now = 0; now < 3'000'000; now += 1000)
    longest = std::max(longest, link.send(segment, now) - now);
  EXPECT_EQ(longest, 10'000 + 20'000 + 200'000) << "delay, round trip, retransmission timeout";
}

/// The throughput and window of a sender that always has more data.
struct Transfer {
  explicit Transfer(std::string_view text) : settings(parse_link("", text)) {}

  void run_until(std::int64_t end_us) {
    while (now_us < end_us) {
      const std::size_t segments = link.room_bytes(now_us) / segment;
      for (std::size_t i = 0; i < segments; ++i, ++sent) {
        const std::int64_t sent_us = now_us;
        slowest_us = std::max(slowest_us, link.send(segment, now_us) - sent_us);
      }
      now_us = std::max(now_us + 100, std::min(link.next_room_us(), end_us));
    }
  }
  [[nodiscard]] double bits_per_s() const {
    return 8e6 * static_cast<double>(sent * segment) / static_cast<double>(now_us);
  }

  LinkSettings settings;
  LinkShaper link{settings, settings.down, 7};
  std::int64_t now_us = 0;
  std::int64_t slowest_us = 0;
  std::size_t sent = 0;
};

TEST(LinkShaper, ASenderStartsWithTenSegmentsAndDoublesThem) {
  Transfer transfer("delay=50ms");
  for (const std::size_t segments : {10u, 30u, 70u, 150u}) {
    transfer.run_until(transfer.now_us + 100'000 - transfer.now_us % 100'000);
    EXPECT_EQ(transfer.sent, segments);
  }
}

/// RFC 9438, 5.1: at such a loss CUBIC's mean window is Reno's, 1.22 / sqrt(loss). Random losses,
/// and timeouts after three in a row, cost some of that.
TEST(LinkShaper, LossCostsTheRateThatItCostsCubic) {
  for (const double loss : {0.005, 0.01, 0.03}) {
    Transfer transfer(fmt::format("delay=25ms,loss={}", loss));
    transfer.run_until(300'000'000);
    const double expected = 1.22 / std::sqrt(loss) * segment * 8.0 / 0.050;
    EXPECT_GT(transfer.bits_per_s(), 0.6 * expected) << loss;
    EXPECT_LT(transfer.bits_per_s(), 1.2 * expected) << loss;
  }
}

TEST(LinkShaper, ASenderFillsItsBottleneckAndLosesWhatIsBeyond) {
  Transfer transfer("rate=20mbit,delay=25ms,queue=100ms");
  transfer.run_until(60'000'000);
  EXPECT_GT(transfer.bits_per_s(), 0.9 * 20e6);
  EXPECT_GT(transfer.slowest_us, 200'000) << "a full buffer, and the round trip of a repetition";
  EXPECT_LT(transfer.link.window().segments() * segment * 8.0, 20e6 * 0.150 * 1.1);
}

TEST(LinkShaper, ASlowSenderIsNotHeldBack) {
  Transfer lossy("rate=20mbit,delay=25ms");
  for (std::int64_t now_us = 0; now_us < 10'000'000; now_us += 33'000) {
    ASSERT_GE(lossy.link.room_bytes(now_us), 5 * segment);
    for (int i = 0; i < 5; ++i)
      EXPECT_LE(lossy.link.send(segment, now_us) - now_us, 25'000 + 5 * 600);
  }
}

}  // namespace
}  // namespace catgs::load
