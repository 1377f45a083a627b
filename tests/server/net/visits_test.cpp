// Integration: pages of counts on the admin port. Real sockets on loopback, a whole server in this
// process.

#include "server/base/clock.h"
#include "server/counts/usage_statistics.h"
#include "tests/support/raw_socket.h"
#include "tests/support/server_client.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test.h"

namespace catgs::test {
namespace {

TEST(OwnVisits, AreForHoldersOfAuthorLinks) {
  const RunningServer server([](ServerConfig& config) { config.token_key_file = link_key_file(); });
  const auto counts_by = [&](const std::string& token) {
    return http_get(server.port(), "/visits.json", bearer(token));
  };
  const HttpReply own = counts_by(make_link("author"));
  EXPECT_EQ(own.status, 200);
  EXPECT_THAT(own.body, AllOf(HasSubstr("Visits: your scenes"), Not(HasSubstr("csv"))));
  EXPECT_EQ(counts_by(make_link("viewer")).status, 401);
  EXPECT_EQ(counts_by(make_link("author", "elsewhere")).status, 401);
  EXPECT_EQ(http_get(server.port(), "/visits.json").status, 401);
  EXPECT_EQ(http_get(server.port(), "/visits.csv").status, 404);
}

class Visits : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder = std::make_unique<TemporaryFolder>();
    std::int64_t day_s = unix_now_s();
    VisitCounts counts([&] { return day_s; });
    Background background;
    {
      const UsageStatistics book(folder->path(), counts, background);
      for (int day = 0; day < 5; ++day, day_s -= 86'400)
        for (std::uint32_t stop = 0; stop < 2000; ++stop) counts.reach("hall", {0, stop});
    }
    server = std::make_unique<RunningServer>(
        [](ServerConfig& config) { config.visit_counts = folder->path().string(); });
  }
  static void TearDownTestSuite() {
    server.reset();
    folder.reset();
  }
  static std::string answer(const std::string& request_line) {
    return raw_answer(server->admin_port(), request_line + "\r\nHost: 127.0.0.1\r\n\r\n");
  }

  static inline std::unique_ptr<TemporaryFolder> folder;
  static inline std::unique_ptr<RunningServer> server;
};

TEST_F(Visits, AreSentAsFarAsTheyAreRead) {
  const HttpReply csv = http_get(server->admin_port(), "/visits/stops.csv");
  EXPECT_EQ(csv.status, 200);
  EXPECT_EQ(csv.headers.at("transfer-encoding"), "chunked");
  EXPECT_FALSE(csv.headers.contains("content-length"));
  EXPECT_EQ(std::ranges::count(csv.body, '\n'), 1 + 5 * 2000) << "of several pieces";
  EXPECT_THAT(csv.body, EndsWith("\"tour 1\",\"stop 2000\",1\r\n"));
  const HttpReply counts = http_get(server->admin_port(), "/visits.json?days=7&scene=hall");
  EXPECT_THAT(counts.body, AllOf(HasSubstr("Visits: hall, 7 days"), EndsWith("]}}]}")));
}

TEST_F(Visits, ThePageComesFromTheClientAndHasAPolicyOfItsOwn) {
  const TemporaryFolder client;
  const auto page_of = [&] {
    const RunningServer with_client(
        [&](ServerConfig& config) { config.client_dir = client.path().string(); });
    return http_get(with_client.admin_port(), "/visits?days=7");
  };
  client.write("index.html", "<p>the client</p>");
  EXPECT_EQ(page_of().status, 404);
  client.write("charts.html", "<p>charts</p>");
  const HttpReply page = page_of();
  EXPECT_EQ(page.body, "<p>charts</p>");
  EXPECT_THAT(page.headers.at("content-security-policy"), HasSubstr("connect-src 'self'"));
}

TEST_F(Visits, HaveNoChunksForClientsOfHttp10) {
  const std::string old = answer("GET /visits.csv HTTP/1.0");
  EXPECT_THAT(old, AllOf(Not(HasSubstr("chunked")), HasSubstr("\r\n\r\ndate,scene,visits"),
                         EndsWith(",0,0,0,0,0,0,0\r\n")));
  const std::string head = answer("HEAD /visits.csv HTTP/1.1");
  EXPECT_THAT(head, AllOf(HasSubstr(" 200 "), EndsWith("\r\n\r\n"), Not(HasSubstr("date,scene"))));
}

TEST_F(Visits, AClientThatGoesLosesOnlyItsConnection) {
  for (int i = 0; i < 20; ++i) {
    RawSocket gone(server->admin_port());
    gone.send("GET /visits/stops.csv HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n");
  }
  EXPECT_EQ(http_get(server->admin_port(), "/visits.csv").status, 200);
  RawSocket last(server->admin_port());
  last.send("GET /visits/stops.csv HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n");
  TearDownTestSuite();  // while it is being answered
  SetUpTestSuite();
}

}  // namespace
}  // namespace catgs::test
