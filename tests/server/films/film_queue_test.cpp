#include "server/films/film_queue.h"

#include <array>
#include <cstdio>

#include <gtest/gtest.h>

namespace catgs {
namespace {

using namespace std::chrono_literals;

class FilmQueueTest : public testing::Test {
 protected:
  std::string order(const std::string& owner) {
    const auto added = queue.add("hall", owner, FilmWish{FilmKind::film, {16, 16}, {FilmView{}}});
    const auto* id = std::get_if<std::string>(&added);
    return id ? *id : "";
  }
  FilmState state(const std::string& id) { return queue.find(id).value().state; }
  /// Draws what waits.
  std::string draw(const std::string& owner) {
    const std::string id = order(owner);
    EXPECT_TRUE(queue.start_next());
    queue.finish(id, std::make_shared<ResultFile>());
    return id;
  }

  TimePoint now = TimePoint{} + 1h;
  FilmQueue queue{[this] { return now; }};
};

TEST_F(FilmQueueTest, DrawsOneAfterTheOther) {
  const std::string first = order("ada"), second = order("bob");
  EXPECT_EQ(state(first), FilmState::waiting);
  const auto started = queue.start_next();
  ASSERT_TRUE(started);
  EXPECT_EQ(started->id, first);
  EXPECT_EQ(started->wish.views.size(), 1u);
  now += 10s;
  EXPECT_TRUE(queue.drawn(first, 0.25));
  EXPECT_EQ(queue.left(*queue.find(first)), 30s);
  queue.finish(first, std::make_shared<ResultFile>());
  EXPECT_EQ(state(first), FilmState::done);
  EXPECT_EQ(queue.start_next()->id, second);
  queue.fail(second, "no room");
  EXPECT_EQ(queue.find(second)->error, "no room");
  EXPECT_FALSE(queue.start_next());
}

TEST_F(FilmQueueTest, TakesOneJobOfEachAndFewInAll) {
  const std::string first = order("ada");
  EXPECT_EQ(order("ada"), "") << "one at a time";
  queue.start_next();
  EXPECT_EQ(order("ada"), "") << "also while it is drawn";
  for (const char* owner : {"b", "c", "d", "e"}) EXPECT_NE(order(owner), "");
  EXPECT_EQ(order("f"), "") << "four wait";
  queue.finish(first, std::make_shared<ResultFile>());
  EXPECT_EQ(order("ada"), "") << "four wait still";
  queue.start_next();
  EXPECT_NE(order("ada"), "");
}

TEST_F(FilmQueueTest, CancelsWhatWaitsAndWhatIsDrawn) {
  const std::string first = order("ada"), second = order("bob");
  queue.start_next();
  EXPECT_TRUE(queue.cancel(second));
  EXPECT_TRUE(queue.cancel(first));
  EXPECT_FALSE(queue.drawn(first, 0.5)) << "whoever draws hears of it";
  queue.finish(first, std::make_shared<ResultFile>());
  EXPECT_EQ(state(first), FilmState::cancelled);
  EXPECT_FALSE(queue.start_next());
  EXPECT_FALSE(queue.cancel(first));
  EXPECT_FALSE(queue.cancel("nothing"));
}

TEST_F(FilmQueueTest, KeepsResultsForAnHourAndAFewOfThem) {
  const std::string first = draw("ada");
  EXPECT_EQ(first.size(), 32u) << "128 bits in hexadecimal";
  now += 59min;
  EXPECT_TRUE(queue.find(first)->result);
  now += 2min;
  EXPECT_FALSE(queue.find(first));
  const std::string second = draw("ada");
  for (std::size_t i = 0; i < FilmQueue::most_kept; ++i) draw("ada");
  EXPECT_FALSE(queue.find(second));
}

TEST(ResultFile, HasNoNameAndIsReadByPieces) {
  const ResultFile file;
  EXPECT_EQ(file.size(), 0u);
  std::FILE* const out = std::fopen(file.path().c_str(), "wb");
  ASSERT_NE(out, nullptr);
  std::fputs("abcdef", out);
  std::fclose(out);
  EXPECT_EQ(file.size(), 6u);
  std::array<std::byte, 3> piece{};
  EXPECT_TRUE(file.read(2, piece));
  EXPECT_EQ(piece[0], std::byte{'c'});
  EXPECT_FALSE(file.read(4, piece)) << "it ends before";
}

}  // namespace
}  // namespace catgs
