#include "server/session/spectator_hub.h"

#include <gtest/gtest.h>

#include "server/schedule/pool_executor.h"
#include "server/session/session_registry.h"

namespace catgs {
namespace {

using namespace std::chrono_literals;

struct FakeConnection final : Connection {
  int messages = 0;
  std::vector<std::uint64_t> frames;
  bool full = false;  // of frames that are not read
  std::optional<CloseCode> closed;

  void send(OutgoingMessage) override { ++messages; }
  std::vector<std::uint64_t> send(OutgoingFrame frame) override {
    if (full) return {frame.ticket.frame_id};
    frames.push_back(frame.ticket.frame_id);
    return {};
  }
  void close(CloseCode code, std::string_view) override { closed = code; }
  [[nodiscard]] std::string peer_address() const override { return "192.0.2.1"; }
  [[nodiscard]] std::size_t queued_frames() const override { return 0; }
};

/// No test here is about scenes.
struct NoScenes final : SceneSource {
  [[nodiscard]] std::string default_scene() const override { return {}; }
  [[nodiscard]] std::vector<std::string> scene_ids() const override { return {}; }
  [[nodiscard]] bool has(const std::string&) const override { return false; }
  SceneAnswer want(const std::string&, TimePoint) override { return SceneAwaited{}; }
  void on_tick(TimePoint) override {}
};

class SpectatorHubTest : public testing::Test {
 protected:
  std::shared_ptr<FakeConnection> join() {
    auto connection = std::make_shared<FakeConnection>();
    peers.push_back(std::make_shared<Peer>(registry, connection));
    hub.add(peers.back(), Welcome{});
    return connection;
  }
  void frame(std::uint64_t id, bool idr = false) {
    OutgoingFrame outgoing;
    outgoing.ticket.frame_id = id;
    outgoing.ticket.idr = idr;
    hub.send(outgoing, now);
  }

  TimePoint now = TimePoint{} + 1h;
  boost::asio::io_context io;
  Metrics metrics;
  NoScenes scenes;
  SessionRegistry registry{io,
                           {},
                           std::make_shared<PoolExecutor>(std::make_shared<ThreadPool>(1)),
                           scenes,
                           {EncoderChoice{}},
                           [](const auto&) { return [](auto, Use) { return std::nullopt; }; },
                           SessionTokens("a key"),
                           metrics};
  SpectatorHub hub{2};
  std::vector<std::shared_ptr<Peer>> peers;
};

TEST_F(SpectatorHubTest, FramesBeginWithAnIdr) {
  const auto spectator = join();
  EXPECT_EQ(spectator->messages, 1) << "the welcome";
  EXPECT_TRUE(hub.wants_idr(now));
  frame(1);
  EXPECT_TRUE(spectator->frames.empty()) << "nothing that it could decode";
  frame(2, true);
  frame(3);
  EXPECT_EQ(spectator->frames, (std::vector<std::uint64_t>{2, 3}));
  EXPECT_FALSE(hub.wants_idr(now + 1h));
}

TEST_F(SpectatorHubTest, ASlowOneDropsToTheNextIdrAndDisturbsNobody) {
  const auto good = join();
  const auto slow = join();
  EXPECT_TRUE(hub.full());
  frame(1, true);
  slow->full = true;
  frame(2);
  slow->full = false;
  frame(3);
  EXPECT_EQ(slow->frames, (std::vector<std::uint64_t>{1}));
  EXPECT_EQ(good->frames, (std::vector<std::uint64_t>{1, 2, 3}));
  EXPECT_FALSE(hub.wants_idr(now + 999ms)) << "an IDR a second at most, whoever waits";
  EXPECT_TRUE(hub.wants_idr(now + 1s));
  now += 1s;
  frame(4, true);
  frame(5);
  EXPECT_EQ(slow->frames, (std::vector<std::uint64_t>{1, 4, 5}));
}

TEST_F(SpectatorHubTest, ALostDecoderAsksForItself) {
  const auto spectator = join();
  frame(1, true);
  hub.needs_idr(*peers[0]);
  frame(2);
  EXPECT_EQ(spectator->frames, (std::vector<std::uint64_t>{1}));
  EXPECT_TRUE(hub.wants_idr(now + 1s));
}

TEST_F(SpectatorHubTest, IsNeverSilentForLong) {
  const auto spectator = join();
  for (auto waited = 0ms; waited < 10s; waited += 250ms) hub.keep_talking(now + waited);
  EXPECT_GE(spectator->messages, 1 + 10);
  EXPECT_LE(spectator->messages, 1 + 14);
}

TEST_F(SpectatorHubTest, EndsWithTheSession) {
  const auto first = join();
  const auto second = join();
  hub.remove(*peers[0]);
  EXPECT_EQ(hub.size(), 1u);
  hub.dismiss_all();
  EXPECT_EQ(second->closed, CloseCode::normal);
  EXPECT_FALSE(first->closed);
  EXPECT_EQ(hub.size(), 0u);
}

}  // namespace
}  // namespace catgs
