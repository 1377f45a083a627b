#include "server/access/access.h"

#include <optional>

#include <fmt/format.h>
#include <sys/stat.h>

#include "tests/support/descriptor_limit.h"
#include "tests/support/log_lines.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test.h"

namespace catgs {
namespace {

constexpr std::string_view key = "0123456789abcdef0123456789abcdef";

class AccessTest : public testing::Test {
 protected:
  static Refusal refusal(AccessControl& access, std::string_view token, std::string_view scene_id,
                         std::int64_t now_unix_s, Use use = Use::own_session) {
    return access.permit(token, now_unix_s, one_hall).refusal(scene_id, use);
  }
  /// Of a server on which one scene alone is called "hall".
  static std::string one_hall(std::string_view name) {
    return name == "hall" ? "hall-bcdfghjk" : std::string(name);
  }
  const test::TemporaryFolder folder;
};

TEST_F(AccessTest, LinksCarryTheirGrant) {
  const std::string token = make_link_token({"city", "viewer", 1000}, key);
  const auto grant = read_link_token(token, key);
  ASSERT_TRUE(grant);
  EXPECT_EQ(grant->scene_id, "city");
  EXPECT_EQ(grant->role, "viewer");
  EXPECT_EQ(grant->expires_unix_s, 1000);
  EXPECT_FALSE(read_link_token(token, "another key of some length"));
}

TEST_F(AccessTest, AChangedLinkIsNoLink) {
  const std::string token = make_link_token({"city", "viewer", 1000}, key);
  for (std::size_t i = 0; i < token.size(); ++i) {
    // The last digit of a part has bits that mean nothing. A link has one form nevertheless, as
    // what it may have is counted by that.
    for (const char digit :
         std::string_view("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz")) {
      std::string changed = token;
      changed[i] = digit;
      EXPECT_EQ(read_link_token(changed, key).has_value(), changed == token) << changed;
    }
  }
  EXPECT_FALSE(read_link_token(token + " ", key));
  EXPECT_FALSE(read_link_token(" " + token, key));
  for (const char* nonsense : {"", ".", "a", "a.b", "=.=", "....", "!!!.!!!"})
    EXPECT_FALSE(read_link_token(nonsense, key)) << nonsense;
}

TEST_F(AccessTest, LinksExpireAndBelongToAScene) {
  AccessControl access({}, folder.write("key", std::string(key) + "\n"));
  const std::string token = make_link_token({"city", "viewer", 1000}, key);
  EXPECT_FALSE(refusal(access, token, "city", 999));
  EXPECT_THAT(refusal(access, token, "city", 1000), Optional(HasSubstr("expired")));
  EXPECT_THAT(refusal(access, token, "garden", 999), Optional(HasSubstr("another scene")));
  EXPECT_FALSE(refusal(access, make_link_token({"", "viewer", 1000}, key), "garden", 999));
  EXPECT_TRUE(refusal(access, "", "city", 0));
  EXPECT_TRUE(refusal(access, "guess", "city", 0));
}

TEST_F(AccessTest, LinksBelongToOneOfSeveralScenesOfAName) {
  AccessControl access({}, folder.write("key", std::string(key) + "\n"));
  const std::string named = make_link_token({"hall", "author", 1000}, key);
  EXPECT_FALSE(refusal(access, named, "hall-bcdfghjk", 0, Use::save));
  const std::string other = make_link_token({"hall-vvvvvvvv", "author", 1000}, key);
  EXPECT_FALSE(refusal(access, other, "hall-vvvvvvvv", 0, Use::save));
  EXPECT_THAT(refusal(access, other, "hall-bcdfghjk", 0, Use::save),
              Optional(HasSubstr("made for another scene called \"hall\"")));
  EXPECT_TRUE(refusal(access, other, "garden-bcdfghjk", 0));
}

TEST_F(AccessTest, RolesSayWhatALinkIsFor) {
  AccessControl access({}, folder.write("key", std::string(key) + "\n"));
  const auto may = [&](const char* role, Use use) {
    return !refusal(access, make_link_token({"city", role, 1000}, key), "city", 0, use);
  };
  for (const char* role : {"viewer", "author", "spectator", "solo"}) {
    EXPECT_TRUE(may(role, Use::list)) << role;
    EXPECT_EQ(may(role, Use::save), std::string_view(role) == "author") << role;
  }
  EXPECT_TRUE(may("author", Use::own_session));
  EXPECT_TRUE(may("viewer", Use::own_session));
  EXPECT_TRUE(may("viewer", Use::watch));
  EXPECT_FALSE(may("spectator", Use::own_session));
  EXPECT_TRUE(may("spectator", Use::watch));
  EXPECT_TRUE(may("solo", Use::own_session));
  EXPECT_FALSE(may("solo", Use::watch));
  EXPECT_THROW(make_link_token({"city", "emperor", 1000}, key), InputError);
  EXPECT_THROW(make_link_token({"no\nid", "viewer", 1000}, key), InputError);
}

TEST_F(AccessTest, OnlyLinksMakeAuthors) {
  AccessControl open({}, {});
  EXPECT_FALSE(refusal(open, "", "city", 0));
  EXPECT_THAT(refusal(open, "", "city", 0, Use::save), Optional(HasSubstr("--token-key-file")));
  AccessControl by_file(folder.write("tokens", "open-sesame\n"),
                        folder.write("key", std::string(key) + "\n"));
  EXPECT_FALSE(refusal(by_file, "open-sesame", "city", 0));
  EXPECT_THAT(refusal(by_file, "open-sesame", "city", 0, Use::save),
              Optional(HasSubstr("role author")));
  const std::string link = make_link_token({"city", "author", 1000}, key);
  EXPECT_FALSE(refusal(by_file, link, "city", 999, Use::save));
  EXPECT_TRUE(refusal(by_file, link, "city", 1000, Use::save)) << "expired";
  EXPECT_TRUE(refusal(by_file, link, "garden", 999, Use::save)) << "another scene";
}

TEST_F(AccessTest, AnOpenServerShowsItsScenesWithoutATokenAndBelievesTokens) {
  AccessControl open({}, folder.write("key", std::string(key) + "\n"), true);
  EXPECT_FALSE(refusal(open, "", "city", 0));
  EXPECT_TRUE(refusal(open, "", "city", 0, Use::save));
  const std::string author = make_link_token({"city", "author", 1000}, key);
  EXPECT_FALSE(refusal(open, author, "city", 0, Use::save));
  EXPECT_TRUE(refusal(open, author, "garden", 0));
  EXPECT_TRUE(refusal(open, make_link_token({"", "spectator", 1000}, key), "city", 0));
  EXPECT_TRUE(refusal(open, "no-token-of-ours", "city", 0));
}

TEST_F(AccessTest, LinksAreKnownByTheirIds) {
  const std::string id = new_link_id();
  EXPECT_NE(id, new_link_id());
  const std::string token = make_link_token({"city", "viewer", 1000, id}, key);
  EXPECT_EQ(read_link_token(token, key)->id, id);
  EXPECT_THROW(make_link_token({"city", "viewer", 1000, "no id"}, key), InputError);

  const std::string old = make_link_token({"city", "viewer", 1000}, key);
  const std::string other = make_link_token({"city", "viewer", 1001}, key);
  EXPECT_EQ(read_link_token(old, key)->id.size(), id.size()) << "made before links had ids";
  EXPECT_EQ(read_link_token(old, key)->id, read_link_token(old, key)->id);
  EXPECT_NE(read_link_token(old, key)->id, read_link_token(other, key)->id);

  AccessControl access({}, folder.write("key", std::string(key)));
  EXPECT_EQ(access.permit(token, 0, one_hall).link_id, id);
  EXPECT_EQ(access.permit(token, 2000, one_hall).link_id, id) << "the log names who comes too late";
  EXPECT_EQ(access.permit(token + "x", 0, one_hall).link_id, "");
  EXPECT_FALSE(refusal(access, old, "city", 0)) << "they stay valid";
}

TEST_F(AccessTest, LinksEndOneByOneWhenTheirIdsAreRevoked) {
  const std::string lost = make_link_token({"city", "author", 1000, "0123456789ab"}, key);
  const std::string kept = make_link_token({"city", "author", 1000, "0123456789ac"}, key);
  const std::string old = make_link_token({"city", "viewer", 1000}, key);
  const auto path = folder.write("revoked", "# none yet\n");
  AccessControl access({}, folder.write("key", std::string(key)), false, path);
  EXPECT_FALSE(refusal(access, lost, "city", 0));

  const auto later = std::filesystem::last_write_time(path) + std::chrono::seconds(2);
  folder.write("revoked", "0123456789ab  # class 4b\r\n\n" + read_link_token(old, key)->id);
  std::filesystem::last_write_time(path, later);
  EXPECT_THAT(refusal(access, lost, "city", 0), Optional(HasSubstr("revoked")));
  EXPECT_TRUE(refusal(access, lost, "city", 0, Use::save));
  EXPECT_TRUE(refusal(access, old, "city", 0)) << "an old one has an id, too";
  EXPECT_FALSE(refusal(access, kept, "city", 0));
  EXPECT_EQ(access.revoked_links()->size(), 2u);

  folder.write("revoked", "0123456789ac\nwhich one?\n");
  std::filesystem::last_write_time(path, later + std::chrono::seconds(2));
  EXPECT_TRUE(refusal(access, lost, "city", 0)) << "a mistake in the file revives no link";
  std::filesystem::remove(path);
  EXPECT_TRUE(refusal(access, lost, "city", 0)) << "nor does its loss";
}

TEST_F(AccessTest, AnEmptiedFileRevivesNoLink) {
  const std::string lost = make_link_token({"city", "viewer", 1000, "0123456789ab"}, key);
  const auto path = folder.write("revoked", "0123456789ab\n");
  AccessControl access({}, folder.write("key", std::string(key)), false, path);
  auto time = std::filesystem::last_write_time(path);
  const auto write = [&](const std::string& text) {
    folder.write("revoked", text);
    std::filesystem::last_write_time(path, time += std::chrono::seconds(2));
  };
  for (const char* emptied : {"", "\n", " \r\n\n"}) {
    write(emptied);
    EXPECT_TRUE(refusal(access, lost, "city", 0)) << "a loss of its content";
  }
  write("0123456789ac\n");
  EXPECT_FALSE(refusal(access, lost, "city", 0)) << "somebody took it out";
  write("0123456789ab\n");
  EXPECT_TRUE(refusal(access, lost, "city", 0));
  write("# none\n");
  EXPECT_FALSE(refusal(access, lost, "city", 0)) << "somebody took the last one out";
}

TEST_F(AccessTest, LostAndEmptyListsAreToldOnce) {
  const auto revoked = folder.write("revoked", "\n"),
             tokens = folder.write("tokens", "alpha-alpha\n");
  std::optional<AccessControl> access;
  EXPECT_THAT(
      test::lines_of("human", "info",
                     [&] { access.emplace(tokens, std::filesystem::path(), false, revoked); }),
      ElementsAre(AllOf(HasSubstr("--revoked-links"), HasSubstr("no link is revoked"))));
  const auto use = [&] {
    for (int i = 0; i < 3; ++i) (void)access->permit("alpha-alpha", 0, one_hall);
  };
  const auto written = std::filesystem::last_write_time(tokens);
  std::filesystem::remove(tokens);
  EXPECT_THAT(test::lines_of("human", "info", use),
              ElementsAre(AllOf(HasSubstr("tokens: cannot be opened"),
                                HasSubstr("the tokens read before stay in force"))));
  folder.write("tokens", "alpha-alpha\n");
  std::filesystem::last_write_time(tokens, written + std::chrono::seconds(2));
  EXPECT_THAT(test::lines_of("human", "info", use), ElementsAre(HasSubstr("were read again")));
}

TEST_F(AccessTest, APipeInPlaceOfAListIsNotWaitedFor) {
  const std::string lost = make_link_token({"city", "viewer", 1000, "0123456789ab"}, key);
  const auto revoked = folder.write("revoked", "0123456789ab\n");
  const auto tokens = folder.write("tokens", "alpha-alpha\n");
  AccessControl access(tokens, folder.write("key", std::string(key)), false, revoked);
  for (const auto& path : {revoked, tokens}) {
    std::filesystem::remove(path);
    ASSERT_EQ(::mkfifo(path.c_str(), 0600), 0);
  }
  EXPECT_TRUE(refusal(access, lost, "city", 0));
  EXPECT_FALSE(refusal(access, "alpha-alpha", "city", 0)) << "those read before stay in force";
  EXPECT_EQ(test::refused_field([&] { AccessControl(tokens, {}); }), "--token-file");
  EXPECT_THAT([&] { read_key_file("--token-key-file", tokens); },
              ThrowsMessage<InputError>(HasSubstr("it is not a regular file")));
}

TEST_F(AccessTest, AListThatCannotBeReadNowIsReadLater) {
  const std::string lost = make_link_token({"city", "viewer", 1000, "0123456789ab"}, key);
  const auto path = folder.write("revoked", "# none\n");
  AccessControl access({}, folder.write("key", std::string(key)), false, path);
  const auto later = std::filesystem::last_write_time(path) + std::chrono::seconds(2);
  folder.write("revoked", "0123456789ab\n");
  std::filesystem::last_write_time(path, later);
  {
    const test::DescriptorLimit none_is_left(test::next_descriptor());
    EXPECT_FALSE(refusal(access, lost, "city", 0)) << "those read before stay in force";
  }
  EXPECT_TRUE(refusal(access, lost, "city", 0));
}

TEST_F(AccessTest, RevokedLinksHaveANumberAndAForm) {
  const auto of = [&](const std::string& text) {
    AccessControl({}, folder.write("key", std::string(key)), false, folder.write("revoked", text));
  };
  const auto mistake = [&](const std::string& text) {
    return test::refused_field([&] { of(text); });
  };
  const std::string file = "--revoked-links " + (folder / "revoked").string();
  EXPECT_EQ(mistake("0123456789ab\n" + make_link_token({"", "viewer", 1}, key)), file + ":2");
  EXPECT_EQ(mistake("3F0C91D27A5E\n"), file + ":1")
      << "ids are in small letters: it would end nothing";
  std::string many;
  for (int i = 0; i < 100'000; ++i) many += fmt::format("{:06x}\n", i);
  EXPECT_EQ(mistake(many), "");
  EXPECT_EQ(mistake(many + "ffffff\n"), file);
}

TEST_F(AccessTest, StaticTokenEndsWhenItLeavesItsFile) {
  const auto path = folder.write("tokens", "alpha-alpha\nbeta-beta\n");
  AccessControl access(path, folder.write("key", std::string(key)), false, {}, "own key");
  AccessControl other(path, {}, false, {}, "own key"), stranger(path, {});
  const auto id_of = [](AccessControl& by, std::string_view token) {
    return by.permit(token, 0, one_hall).token_id;
  };
  const std::string alpha = id_of(access, "alpha-alpha"), beta = id_of(access, "beta-beta");
  EXPECT_NE(alpha, beta);
  EXPECT_EQ(id_of(access, "gamma-gamma"), "");
  EXPECT_EQ(id_of(other, "alpha-alpha"), alpha) << "servers of a fleet know it";
  EXPECT_NE(id_of(stranger, "alpha-alpha"), alpha) << "it tells nothing of the token";
  EXPECT_EQ(access.permit("alpha-alpha", 0, one_hall).link_id, "");
  EXPECT_FALSE(access.ended(alpha) || access.ended(beta));
  EXPECT_TRUE(access.ended("")) << "nobody is here without a token";
  EXPECT_FALSE(AccessControl(path, {}, true).ended(""));

  const auto later = std::filesystem::last_write_time(path) + std::chrono::seconds(2);
  folder.write("tokens", "beta-beta\n");
  std::filesystem::last_write_time(path, later);
  EXPECT_TRUE(access.ended(alpha));
  EXPECT_FALSE(access.ended(beta));
}

TEST_F(AccessTest, StaticTokensAreReadAgain) {
  const auto path = folder.write("tokens", "# first\nalpha-alpha\n");
  AccessControl access(path, {});
  EXPECT_FALSE(refusal(access, "alpha-alpha", "city", 0));
  EXPECT_TRUE(refusal(access, "alpha-alph", "city", 0));
  EXPECT_TRUE(refusal(access, "# first", "city", 0));

  const auto later = std::filesystem::last_write_time(path) + std::chrono::seconds(2);
  folder.write("tokens", "beta-beta\n");
  std::filesystem::last_write_time(path, later);
  EXPECT_TRUE(refusal(access, "alpha-alpha", "city", 0));
  EXPECT_FALSE(refusal(access, "beta-beta", "city", 0));

  folder.write("tokens", "x\n");  // too short: the good ones stay
  std::filesystem::last_write_time(path, later + std::chrono::seconds(2));
  EXPECT_FALSE(refusal(access, "beta-beta", "city", 0));
}

TEST_F(AccessTest, APermitChecksItsTokenOnceForAllScenes) {
  const auto path = folder.write("tokens", "alpha-alpha\n");
  AccessControl access(path, {});
  const Permit permit = access.permit("alpha-alpha", 0, one_hall);
  const auto later = std::filesystem::last_write_time(path) + std::chrono::seconds(2);
  folder.write("tokens", "beta-beta\n");
  std::filesystem::last_write_time(path, later);
  EXPECT_TRUE(permit.allows("city", Use::own_session)) << "nothing is read for another scene";
  EXPECT_TRUE(refusal(access, "alpha-alpha", "city", 0)) << "the next request finds it gone";
}

TEST_F(AccessTest, EverybodyMayEnterWhenNoFilesAreGiven) {
  AccessControl access({}, {});
  EXPECT_FALSE(refusal(access, "", "city", 0));
}

TEST_F(AccessTest, FilesThatCannotBeReadAreNamedWithTheirFlag) {
  const std::string absent = folder / "absent";
  const auto read = [](const std::string& tokens, const std::string& file_of_key) {
    return test::refused_field([&] { AccessControl(tokens, file_of_key); });
  };
  EXPECT_EQ(read(absent, {}), "--token-file");
  EXPECT_EQ(read({}, absent), "--token-key-file " + absent);
  EXPECT_EQ(read(folder.path().string(), {}), "--token-file");
  EXPECT_THAT(
      [&] { AccessControl(absent, {}); },
      ThrowsMessage<InputError>(AllOf(HasSubstr(absent), HasSubstr("No such file or directory"),
                                      HasSubstr("check the path"))));
}

TEST_F(AccessTest, NamesTheArgumentThatIsWrong) {
  const std::string short_key = folder.write("short", "abc").string();
  EXPECT_EQ(test::refused_field([&] { read_key_file("--token-key-file", short_key); }),
            "--token-key-file " + short_key);
  EXPECT_THROW(AccessControl(folder.write("empty", "# nothing\n"), {}), InputError);
  EXPECT_THROW(make_link_token({"city", "A B", 0}, key), InputError);
  for (const char* text :
       {"", "7", "d", "7x", "-1d", "0s", "7d ", "99999999d", "3651d", "99999d", "1000000d"})
    EXPECT_EQ(test::refused_field([&] { parse_duration(text); }), std::string("--expires ") + text);
}

TEST_F(AccessTest, LinksHaveALongestLife) {
  EXPECT_THAT([] { parse_duration("3651d"); }, ThrowsMessage<InputError>(HasSubstr("3650 days")));
  EXPECT_EQ(parse_duration("3650d"), std::chrono::days(3650));
  EXPECT_EQ(parse_duration("7d"), std::chrono::hours(168));
  EXPECT_EQ(parse_duration("90s"), std::chrono::seconds(90));
}

TEST_F(AccessTest, TokensAndKeysHaveALength) {
  const auto tokens = [this](std::size_t bytes) {
    AccessControl(folder.write("tokens", std::string(bytes, 't')), {});
  };
  EXPECT_NO_THROW(tokens(8));
  EXPECT_NO_THROW(tokens(512));
  EXPECT_THROW(tokens(7), InputError);
  EXPECT_THROW(tokens(513), InputError);
  const auto key_of = [this](std::size_t bytes) {
    return read_key_file("--token-key-file", folder.write("key", std::string(bytes, 'k')));
  };
  EXPECT_EQ(key_of(16).size(), 16u);
  EXPECT_THROW(key_of(15), InputError);
}

}  // namespace
}  // namespace catgs
