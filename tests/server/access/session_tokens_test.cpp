#include "server/access/session_tokens.h"

#include "server/access/signed_token.h"
#include "tests/support/test.h"

namespace catgs {
namespace {

constexpr std::int64_t now_s = 1'800'000'000;

TEST(SessionTokens, AServerWithTheSameKeyKnowsThem) {
  const std::string key = random_key();
  const SessionTokens mine(key);
  const SessionTokens other(key);
  const std::string token = mine.resume_token("12ab34cd", "old:town", now_s);
  const auto resumed = other.read_resume_token(token, now_s + 60);
  ASSERT_TRUE(resumed);
  EXPECT_EQ(resumed->session_id, "12ab34cd");
  EXPECT_EQ(resumed->scene_id, "old:town");
  EXPECT_EQ(other.read_watch_token(mine.watch_token("12ab34cd")), "12ab34cd");
  EXPECT_LE(mine.resume_token("12ab34cd", std::string(128, 'x'), now_s).size(), 512u)
      << "the wire takes no longer ones";
}

TEST(SessionTokens, NoOtherTokenPasses) {
  const SessionTokens tokens(random_key());
  const SessionTokens foreign(random_key());
  const std::string resume = tokens.resume_token("12ab34cd", "city", now_s);
  EXPECT_FALSE(foreign.read_resume_token(resume, now_s));
  EXPECT_FALSE(tokens.read_resume_token(tokens.watch_token("12ab34cd"), now_s))
      << "who may watch may not take over";
  EXPECT_FALSE(tokens.read_watch_token(resume));
  EXPECT_FALSE(tokens.read_resume_token("", now_s));
  std::string changed = resume;
  changed[2] = changed[2] == 'A' ? 'B' : 'A';
  EXPECT_FALSE(tokens.read_resume_token(changed, now_s));
}

TEST(SessionTokens, ResumingEndsAfterADay) {
  const SessionTokens tokens(random_key());
  const std::string token = tokens.resume_token("12ab34cd", "city", now_s);
  EXPECT_TRUE(tokens.read_resume_token(token, now_s + 86'400));
  EXPECT_FALSE(tokens.read_resume_token(token, now_s + 86'401));
}

TEST(SessionTokens, APassOpensItsSceneForSomeHours) {
  const SessionTokens tokens(random_key());
  Permit permit;
  permit.token_id = "12ab";
  const std::string pass = tokens.scene_pass("hall", permit, now_s);
  EXPECT_EQ(tokens.read_scene_pass(pass, "hall", now_s + 3600), "12ab");
  EXPECT_FALSE(tokens.read_scene_pass(pass, "attic", now_s));
  EXPECT_FALSE(tokens.read_scene_pass(pass, "hall", now_s + 4 * 3600));
  EXPECT_FALSE(tokens.read_scene_pass(tokens.watch_token("hall"), "hall", now_s));
  EXPECT_FALSE(SessionTokens(random_key()).read_scene_pass(pass, "hall", now_s));
  permit.expires_unix_s = now_s + 60;
  const std::string brief = tokens.scene_pass("hall", permit, now_s);
  EXPECT_TRUE(tokens.read_scene_pass(brief, "hall", now_s + 59));
  EXPECT_FALSE(tokens.read_scene_pass(brief, "hall", now_s + 60)) << "no longer than the token";
}

}  // namespace
}  // namespace catgs
