#include "server/films/film_queue.h"

#include <cstdio>

#include "tests/support/test.h"

namespace catgs {
namespace {

class FilmQueueTest : public testing::Test {
 protected:
  std::string order(const std::string& owner) {
    const auto added =
        queue.add("hall", owner, FilmRequest{FilmKind::film, {16, 16}, {FilmView{}}});
    const auto* id = std::get_if<std::string>(&added);
    return id ? *id : "";
  }
  FilmState state(const std::string& id) { return queue.find(id).value().state; }
  /// Draws what waits. The result has so many bytes.
  std::string draw(const std::string& owner, std::uint64_t bytes = 0) {
    const std::string id = order(owner);
    EXPECT_TRUE(queue.start_next());
    const auto file = std::make_shared<ResultFile>();
    std::filesystem::resize_file(file->path(), bytes);  // a hole, which takes no room
    queue.finish(id, file);
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
  EXPECT_EQ(started->request.views.size(), 1u);
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
  for (std::size_t i = 0; i < FilmQueue::most_results; ++i) draw("ada");
  EXPECT_FALSE(queue.find(second));
}

TEST_F(FilmQueueTest, CancelledOrdersDropNoResult) {
  const std::string film = draw("ada");
  std::string last;
  for (std::size_t i = 0; i < 3 * FilmQueue::most_without_result; ++i) {
    last = order("eve");
    ASSERT_TRUE(queue.cancel(last));
  }
  EXPECT_TRUE(queue.find(film));
  EXPECT_TRUE(queue.find(last)) << "the newest is known";
}

TEST_F(FilmQueueTest, OwnerOfMostResultsLosesTheOldest) {
  const std::string film = draw("ada");
  std::vector<std::string> eves;
  for (std::size_t i = 0; i < 2 * FilmQueue::most_results; ++i) {
    now += 1s;
    eves.push_back(draw("eve"));
  }
  EXPECT_TRUE(queue.find(film));
  EXPECT_FALSE(queue.find(eves.front()));
  EXPECT_TRUE(queue.find(eves.back()));
  EXPECT_TRUE(queue.find(eves[eves.size() - (FilmQueue::most_results - 1)]));
  EXPECT_FALSE(queue.find(eves[eves.size() - FilmQueue::most_results]));
}

TEST_F(FilmQueueTest, OwnerOfMostBytesLosesTheOldest) {
  const std::string film = draw("ada", FilmQueue::most_result_bytes / 4);
  const std::string first = draw("eve", FilmQueue::most_result_bytes / 2);
  EXPECT_TRUE(queue.find(first));
  const std::string second = draw("eve", FilmQueue::most_result_bytes / 2);
  EXPECT_FALSE(queue.find(first));
  EXPECT_TRUE(queue.find(second));
  EXPECT_TRUE(queue.find(film));
}

TEST_F(FilmQueueTest, FloodOfFailuresHidesNoFailureOfOthers) {
  const std::string failed = order("ada");
  queue.start_next();
  queue.fail(failed, "no room");
  for (std::size_t i = 0; i < 2 * FilmQueue::most_without_result; ++i) {
    now += 1s;
    queue.cancel(order("eve"));
  }
  EXPECT_EQ(queue.find(failed)->error, "no room");
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
