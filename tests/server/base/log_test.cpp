#include "server/base/log.h"

#include <climits>
#include <csignal>

#include <fcntl.h>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <spdlog/spdlog.h>
#include <sys/resource.h>
#include <unistd.h>

#include "tests/support/log_lines.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test.h"

namespace catgs {
namespace {

using test::lines_of;

/// Those that a line about nobody, one about a session, and one after it make.
std::vector<std::string> lines(std::string_view format) {
  return lines_of(format, "info", [] {
    spdlog::info("first");
    {
      const LogScope about({.session = "1f2e3d4c5b6a79880f1e2d3c4b5a6978"});
      spdlog::warn("\xff \"quoted\"");
    }
    spdlog::info("last");
  });
}

TEST(Log, JsonLinesNameTheirSession) {
  const auto all = lines("json");
  ASSERT_EQ(all.size(), 3u);
  EXPECT_FALSE(nlohmann::json::parse(all[0]).contains("session"));
  const auto about = nlohmann::json::parse(all[1]);
  EXPECT_EQ(about.at("session"), "1f2e3d4c");
  EXPECT_EQ(about.at("level"), "warning");
  EXPECT_EQ(about.at("message"), "\ufffd \"quoted\"");
  EXPECT_FALSE(nlohmann::json::parse(all[2]).contains("session"));
}

TEST(Log, JsonLinesHaveAFieldForEachFact) {
  const auto all = lines_of("json", "info", [] {
    const LogScope about({.session = "1f2e3d4c5b6a", .scene = "hall", .address = "192.0.2.1"});
    log_info({.event = "session_admitted"}, "{} looks at it", "192.0.2.1");
    log_refusal({.event = "session_refused", .scene = "attic", .code = "server_full"}, "full {}");
    spdlog::info("of a library");
    log_debug({.event = "too_small"}, "not logged");
  });
  ASSERT_EQ(all.size(), 3u);
  const auto facts = [&](std::size_t line) {
    nlohmann::json said = nlohmann::json::parse(all[line]);
    said.erase("time");
    return said;
  };
  EXPECT_EQ(facts(0), (nlohmann::json{{"level", "info"},
                                      {"event", "session_admitted"},
                                      {"session", "1f2e3d4c"},
                                      {"scene", "hall"},
                                      {"address", "192.0.2.1"},
                                      {"message", "192.0.2.1 looks at it"}}));
  EXPECT_EQ(facts(1), (nlohmann::json{{"level", "warning"},
                                      {"event", "session_refused"},
                                      {"session", "1f2e3d4c"},
                                      {"scene", "attic"},
                                      {"address", "192.0.2.1"},
                                      {"code", "server_full"},
                                      {"message", "full {}"}}));
  EXPECT_EQ(facts(2).at("scene"), "hall") << "facts of one line stay with it";
}

TEST(Log, AFailureIsALineWhereProgramsReadTheLog) {
  const auto fail = [] { log_failure("start_failed", "no \x1b scene"); };
  EXPECT_THAT(lines_of("human", "info", fail), ElementsAre("catgs-server: no \\x1b scene"));
  const auto all = lines_of("json", "info", fail);
  ASSERT_EQ(all.size(), 1u);
  EXPECT_EQ(nlohmann::json::parse(all[0]).at("event"), "start_failed");
}

TEST(Log, HumanLinesNameTheirSession) {
  const auto all = lines("human");
  ASSERT_EQ(all.size(), 3u);
  EXPECT_THAT(all[0], EndsWith("info first"));
  EXPECT_THAT(all[1], EndsWith(R"(warning session 1f2e3d4c: \xff "quoted")"));
  EXPECT_THAT(all[2], EndsWith("info last"));
}

TEST(Log, ClientsWriteNeitherLinesNorColours) {
  for (const char* format : {"human", "json"}) {
    const auto all = lines_of(format, "info", [] {
      spdlog::warn("not known as {}", "evil\n12:00:00 info \x1b[2Jall is well");
    });
    ASSERT_EQ(all.size(), 1u) << format;
    EXPECT_THAT(all[0], Not(HasSubstr("\x1b[2J"))) << format;
  }
  const auto c1 = [] { spdlog::warn("not known as {}, {}", "\xc2\x9b\x32Jevil", "\x9b\x32Jevil"); };
  EXPECT_THAT(lines_of("human", "info", c1).at(0),
              EndsWith(R"(not known as \xc2\x9b2Jevil, \x9b2Jevil)"));
  EXPECT_THAT(lines_of("json", "info", c1).at(0),
              EndsWith(R"(not known as \u009b2Jevil, \ufffd2Jevil"})"));
  const auto invisible = [] { spdlog::warn("not known as {}", "a\u202e\u2066\u200b\u2028b"); };
  EXPECT_THAT(lines_of("human", "info", invisible).at(0),
              EndsWith(R"(as a\xe2\x80\xae\xe2\x81\xa6\xe2\x80\x8b\xe2\x80\xa8b)"));
  EXPECT_THAT(lines_of("json", "info", invisible).at(0),
              EndsWith(R"(as a\u202e\u2066\u200b\u2028b"})"));
}

TEST(Log, TellsHowManyLinesItLeftOut) {
  const auto flood = [] {
    for (int i = 0; i < 20'000; ++i) spdlog::warn("one of many");
    std::this_thread::sleep_for(std::chrono::milliseconds(50));  // room for one more, or two
    spdlog::info("last");
  };
  const std::uint64_t lost_before = log_lines_lost();
  const auto bounded = lines_of("human", "info", flood);
  EXPECT_GT(log_lines_lost() - lost_before, 15'000u);
  EXPECT_GE(bounded.size(), 502u);
  EXPECT_LT(bounded.size(), 5000u);
  EXPECT_THAT(bounded.back(), EndsWith("last"));
  EXPECT_THAT(bounded, Contains(HasSubstr("lines were left out")));
  EXPECT_EQ(lines_of("human", "debug", flood).size(), 20'001u);
}

TEST(Log, SaysHowManyItLeftOutOnceASecond) {
  const auto before = std::chrono::steady_clock::now();
  const auto all = lines_of("human", "info", [] {
    for (int round = 0; round < 10; ++round) {
      for (int i = 0; i < 1000; ++i) spdlog::warn("one of many");
      std::this_thread::sleep_for(std::chrono::milliseconds(50));  // room for one more, or two
    }
  });
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - before;
  const auto notes = std::ranges::count_if(
      all, [](auto& line) { return line.find("lines were left out") != std::string::npos; });
  EXPECT_GE(notes, 1);
  EXPECT_LE(static_cast<double>(notes), 1.0 + elapsed.count());
}

TEST(Log, EndlessRefusalsHideNoOtherLine) {
  const std::uint64_t lost_before = log_lines_lost();
  const auto all = lines_of("human", "info", [] {
    for (int i = 0; i < 20'000; ++i) log_refusal({}, "of a stranger");
    for (int i = 0; i < 300; ++i) spdlog::warn("of somebody else");
  });
  EXPECT_EQ(std::ranges::count_if(all, [](auto& line) { return line.ends_with("else"); }), 300);
  const auto refusals =
      std::ranges::count_if(all, [](auto& line) { return line.ends_with("stranger"); });
  EXPECT_GE(refusals, 100);
  EXPECT_LT(refusals, 1000);
  EXPECT_EQ(log_lines_lost() - lost_before, static_cast<std::uint64_t>(20'000 - refusals));
  EXPECT_THAT(all, Contains(HasSubstr("lines were left out")));
}

TEST(Log, NoFloodHidesAnError) {
  const auto all = lines_of("human", "info", [] {
    for (int i = 0; i < 2000; ++i) spdlog::warn("one of many");
    for (int i = 0; i < 200; ++i) log_refusal({}, "of a stranger");
    for (int i = 0; i < 1000; ++i) spdlog::error("grave");
  });
  EXPECT_EQ(std::ranges::count_if(all, [](auto& line) { return line.ends_with("grave"); }), 1000);
}

TEST(Log, TakesLinesAtTheirRates) {
  const auto refusal = [] { log_refusal({}, "line"); };
  const auto warning = [] { spdlog::warn("line"); };
  const auto check = [](const auto& log, double burst, double per_second) {
    const auto before = std::chrono::steady_clock::now();
    const auto all = lines_of("human", "info", [&] {
      for (int i = 0; i < 1000; ++i) log();
      std::this_thread::sleep_for(std::chrono::milliseconds(500));
      for (int i = 0; i < 1000; ++i) log();
    });
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - before;
    const auto taken =
        std::ranges::count_if(all, [](auto& line) { return line.ends_with("line"); });
    EXPECT_GE(static_cast<double>(taken), burst + 0.5 * per_second);
    EXPECT_LE(static_cast<double>(taken), burst + elapsed.count() * per_second + 1);
  };
  check(warning, 500, 50);
  check(refusal, 100, 10);
}

/// Standard error is `descriptor` while `log` logs.
void with_standard_error(int descriptor, const std::function<void()>& log) {
  const int kept = ::dup(STDERR_FILENO);
  ::dup2(descriptor, STDERR_FILENO);
  log();
  ::dup2(kept, STDERR_FILENO);
  ::close(kept);
}

TEST(Log, APipeThatNobodyReadsHoldsNobodyUp) {
  for (const std::size_t length : {1000u, 10'000u}) {  // of a page, and of some
    int pipe[2];
    ASSERT_EQ(::pipe(pipe), 0);
    const std::uint64_t lost_before = log_lines_lost();
    const std::string line(length, '.');
    lines_of("human", "debug", [&] {
      with_standard_error(pipe[1], [&] {
        for (int i = 0; i < 1000; ++i) spdlog::info(line);  // of which a pipe takes 64 KiB
      });
    });
    EXPECT_GT(log_lines_lost() - lost_before, 800u);
    ::close(pipe[0]);
    ::close(pipe[1]);
  }
}

TEST(Log, LinesAreAsLongAsAPipeTakesWhole) {
  for (const char* format : {"human", "json"})
    for (const char* piece : {"a", "\x01", "\u20ac", "\xff"}) {  // as they are, and escaped
      std::string text;
      while (text.size() < 10'000) text += piece;
      const auto all = lines_of(format, "info", [&] { spdlog::info("{}, the end", text); });
      ASSERT_EQ(all.size(), 1u);
      EXPECT_LT(all[0].size(), 4096u);
      EXPECT_GT(all[0].size(), *piece == 'a' ? 4096u - 32 : 4096u / 3);
      EXPECT_THAT(all[0], HasSubstr(fmt::format("... ({} bytes)", text.size() + 9)));
      EXPECT_THAT(all[0], Not(HasSubstr("the end")));
      EXPECT_THAT(all[0], Not(HasSubstr("\\xe2"))) << "characters are cut";
      EXPECT_EQ(nlohmann::json::accept(all[0]), std::string_view(format) == "json");
    }
}

TEST(Log, ADiskThatFillsWithinALineDoesNotSpoilTheNext) {
  const test::TemporaryFolder folder;
  const std::string file = folder.write("log", "").string();
  const int log = ::open(file.c_str(), O_WRONLY | O_APPEND);
  ASSERT_GE(log, 0);
  const std::uint64_t lost_before = log_lines_lost();
  rlimit limit{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &limit), 0);
  const auto former = ::signal(SIGXFSZ, SIG_IGN);
  lines_of("json", "info", [&] {
    with_standard_error(log, [&] {
      const LogScope about({.session = "1f2e3d4c"});
      const rlimit small{100, limit.rlim_max};
      ::setrlimit(RLIMIT_FSIZE, &small);
      for (int i = 0; i < 3; ++i) spdlog::info("while the disk fills, and after it");
      ::setrlimit(RLIMIT_FSIZE, &limit);
      spdlog::info("room again");
    });
  });
  ::signal(SIGXFSZ, former);
  ::close(log);
  std::vector<std::string> all;
  std::ifstream written(file);
  for (std::string line; std::getline(written, line);) all.push_back(line);
  EXPECT_EQ(log_lines_lost() - lost_before, 3u);
  ASSERT_EQ(all.size(), 3u);
  EXPECT_EQ(all[0].size(), 100u) << "torn";
  EXPECT_EQ(nlohmann::json::parse(all[1]).at("message"),
            "3 log lines were dropped: stderr was blocked");
  EXPECT_FALSE(nlohmann::json::parse(all[1]).contains("session")) << "they were anybody's";
  EXPECT_EQ(nlohmann::json::parse(all[1]).at("event"), "log_lines_lost");
  EXPECT_EQ(nlohmann::json::parse(all[2]).at("session"), "1f2e3d4c");
}

}  // namespace
}  // namespace catgs
