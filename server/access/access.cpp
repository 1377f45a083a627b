#include "server/access/access.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <fstream>
#include <iterator>
#include <limits>
#include <span>
#include <sstream>

#include <fmt/format.h>

#include "render_core/base/error.h"
#include "server/base/log_event.h"
#include "server/base/required_file.h"
#include "server/base/scene_id.h"

namespace catgs {
namespace {

constexpr std::string_view link_purpose = "catgs-link-v1", name_purpose = "catgs-token-name-v1";
constexpr std::string_view static_prefix = "token-";  // of ids, which no link's id has
constexpr std::size_t min_key_bytes = 16;
constexpr std::size_t min_token_bytes = 8;
constexpr std::size_t max_token_bytes = 512;
constexpr std::size_t max_link_id_bytes = 32;
constexpr std::size_t max_revoked_links = 100'000;
constexpr std::chrono::days longest_link{3650};

bool is_role(std::string_view role) {
  return role == "viewer" || role == "author" || role == "spectator" || role == "solo";
}

/// Returns why the role forbids a use; nothing: it allows it.
Refusal forbidden(std::string_view role, Use use) {
  if (use == Use::own_session && role == "spectator")
    return "this link lets you watch others, not move by yourself";
  if (use == Use::watch && role == "solo") return "this link does not let you watch others";
  if (use == Use::save && role != "author")
    return "this link does not let you save: ask for one of role author";
  return std::nullopt;
}

std::string other_scene(const LinkGrant& grant, std::string_view scene_id) {
  const std::string_view name = name_in(grant.scene_id);
  if (name != name_in(scene_id)) return "this link is for another scene";
  return fmt::format("this link was made for another scene called \"{}\": ask for a new one", name);
}

bool is_link_id(std::string_view id) {
  return !id.empty() && id.size() <= max_link_id_bytes &&
         id.find_first_not_of("0123456789abcdef") == std::string_view::npos;
}

/// Reads a list again that was changed while the server runs.
void read_again(std::string_view what, ListFile& list, const std::function<void()>& read) {
  try {
    read();
    log_info({.event = "list_read"}, "{} were read again", what);
  } catch (const InputError& bad) {
    if (list.is_news(bad.what()))
      log_error({.event = "list_unreadable"}, "{}; {} read before stay in force", bad.what(), what);
  }
}

}  // namespace

std::string make_link_token(const LinkGrant& grant, std::string_view key) {
  if (!is_role(grant.role))
    throw InputError("--role " + grant.role, {}, "is no role",
                     "use viewer, author, spectator or solo");
  if (!grant.scene_id.empty() && !is_scene_id(grant.scene_id))
    throw InputError("--scene", {}, "is no scene id", "/api/scenes lists them");
  if (!grant.id.empty() && !is_link_id(grant.id))
    throw InputError("id " + grant.id, {}, "is no id of a link");
  std::string payload = fmt::format("{}\n{}\n{}", grant.scene_id, grant.role, grant.expires_unix_s);
  if (!grant.id.empty()) payload += "\n" + grant.id;
  return sign_token(link_purpose, payload, key);
}

std::optional<LinkGrant> read_link_token(std::string_view token, std::string_view key) {
  const auto payload = read_signed_token(link_purpose, token, key);
  if (!payload) return std::nullopt;
  LinkGrant grant;
  std::istringstream lines(*payload);
  std::string expires;
  std::getline(lines, grant.scene_id);
  std::getline(lines, grant.role);
  std::getline(lines, expires);
  std::getline(lines, grant.id);
  const char* end = expires.data() + expires.size();
  if (!is_role(grant.role)) return std::nullopt;
  if (std::from_chars(expires.data(), end, grant.expires_unix_s).ptr != end) return std::nullopt;
  if (grant.id.empty()) {
    const TokenDigest digest = digest_of(token);
    grant.id = fmt::format("{:02x}", fmt::join(std::span(digest).first<6>(), ""));
  }
  return grant;
}

std::string new_link_id() { return random_id().substr(0, 12); }

std::string read_key_file(std::string_view flag, const std::filesystem::path& path) {
  std::ifstream in = open_required_file(flag, path);
  std::string key{std::istreambuf_iterator<char>(in), {}};
  while (!key.empty() && (key.back() == '\n' || key.back() == '\r')) key.pop_back();
  if (key.size() < min_key_bytes)
    throw InputError(
        fmt::format("{} {}", flag, path.string()), {},
        fmt::format("the key has {} bytes, at least {} are needed", key.size(), min_key_bytes),
        "make one: openssl rand -hex 32");
  return key;
}

std::string read_own_key(const std::filesystem::path& resume_key_file,
                         const std::filesystem::path& token_key_file) {
  if (!resume_key_file.empty()) return read_key_file("--resume-key-file", resume_key_file);
  if (!token_key_file.empty()) return read_key_file("--token-key-file", token_key_file);
  return random_key();
}

std::chrono::seconds parse_duration(std::string_view text) {
  std::int64_t count = 0;
  const char* end = text.data() + text.size();
  const auto [at, error] = std::from_chars(text.data(), end, count);
  const std::string_view units = "smhd";
  constexpr std::array<std::int64_t, 4> unit_s = {1, 60, 3600, 86'400};
  const auto unit = at + 1 == end ? units.find(*at) : std::string_view::npos;
  if (error != std::errc() || unit == std::string_view::npos || count < 1 || count > 1'000'000)
    throw InputError("--expires " + std::string(text), {}, "is no duration",
                     "give 90s, 30m, 12h or 7d");
  const std::chrono::seconds duration(count * unit_s[unit]);
  if (duration > longest_link)
    throw InputError("--expires " + std::string(text), {}, "is too long",
                     fmt::format("links live {} days at most", longest_link.count()));
  return duration;
}

AccessControl::AccessControl(std::filesystem::path token_file,
                             const std::filesystem::path& key_file, bool open,
                             std::filesystem::path revoked_links, std::string own_key)
    : open_(open),
      own_key_(std::move(own_key)),
      token_file_("--token-file", std::move(token_file)),
      revoked_file_("--revoked-links", std::move(revoked_links)) {
  if (!key_file.empty()) key_ = read_key_file("--token-key-file", key_file);
  if (token_file_.given()) read_token_file();
  if (revoked_file_.given()) read_revoked_links();
}

Permit AccessControl::permit(std::string_view token, std::int64_t now_unix_s,
                             const ResolveScene& resolve) {
  Permit permit;
  auto granted = read(token, now_unix_s, permit);
  if (auto* grant = std::get_if<LinkGrant>(&granted)) {
    if (!grant->scene_id.empty()) grant->scene_id = resolve(grant->scene_id);
    if (!permit.link_id.empty()) permit.expires_unix_s = grant->expires_unix_s;
  }
  permit.check = [granted = std::move(granted), has_authors = !key_.empty(),
                  has_link = !token.empty()](std::string_view scene_id, Use use) -> Refusal {
    if (use == Use::save && !has_authors)
      return "nobody can save on this server: it was started without --token-key-file, which "
             "links of role author are made with";
    if (const auto* refused = std::get_if<std::string>(&granted)) return *refused;
    if (use == Use::save && !has_link)
      return "only a link of role author lets you save: open the one you were given";
    const auto& grant = std::get<LinkGrant>(granted);
    if (!grant.scene_id.empty() && grant.scene_id != scene_id) return other_scene(grant, scene_id);
    return forbidden(grant.role, use);
  };
  return permit;
}

std::variant<LinkGrant, std::string> AccessControl::read(std::string_view token,
                                                         std::int64_t now_unix_s, Permit& permit) {
  const LinkGrant everything;  // the default grant: all that viewers may do
  if (!token_file_.given() && key_.empty()) return everything;
  if (token.empty() && open_) return everything;
  if (token.empty()) return "this server needs an access token: open the link you were given";
  permit.token_id = id_of_static(token);
  if (!permit.token_id.empty()) return everything;
  if (const auto grant = key_.empty() ? std::nullopt : read_link_token(token, key_)) {
    permit.link_id = permit.token_id = grant->id;
    if (revoked_links()->contains(grant->id)) return std::string(link_revoked);
    if (now_unix_s < grant->expires_unix_s) return *grant;
    return "this link has expired: ask for a new one";
  }
  return "the access token is not valid here";
}

const std::vector<AccessControl::StaticToken>& AccessControl::static_tokens() {
  if (token_file_.changed()) read_again("the tokens", token_file_, [&] { read_token_file(); });
  return tokens_;
}

std::string AccessControl::id_of_static(std::string_view token) {
  if (!token_file_.given()) return {};
  const std::lock_guard lock(mutex_);
  const TokenDigest digest = digest_of(token);
  const StaticToken* found = nullptr;
  for (const StaticToken& known : static_tokens())
    if (equal_in_constant_time(known.digest, digest)) found = &known;
  return found ? found->id : std::string();
}

bool AccessControl::ended(std::string_view token_id) {
  if (token_id.empty()) return !open_ && (token_file_.given() || !key_.empty());
  if (!token_id.starts_with(static_prefix)) return revoked_links()->contains(token_id);
  const std::lock_guard lock(mutex_);
  return std::ranges::count(static_tokens(), token_id, &StaticToken::id) == 0;
}

RevokedLinks AccessControl::revoked_links() {
  const std::lock_guard lock(mutex_);
  if (revoked_file_.changed())
    read_again("the revoked links", revoked_file_, [&] { read_revoked_links(); });
  return revoked_;
}

void AccessControl::read_token_file() {
  std::vector<StaticToken> tokens;
  for (const ListFile::Entry& entry : token_file_.read()) {
    if (entry.text.size() < min_token_bytes || entry.text.size() > max_token_bytes)
      throw InputError(
          entry.place, {},
          fmt::format("a token has {} to {} characters", min_token_bytes, max_token_bytes),
          "make one: openssl rand -hex 16");
    tokens.push_back({digest_of(entry.text),
                      std::string(static_prefix) + keyed_name(name_purpose, entry.text, own_key_)});
  }
  if (tokens.empty())
    throw InputError(token_file_.source(), {}, "no token in it", "make one: openssl rand -hex 16");
  tokens_ = std::move(tokens);
}

void AccessControl::read_revoked_links() {
  auto ids = std::make_shared<LinkIds>();
  for (const ListFile::Entry& entry : revoked_file_.read()) {
    const std::string id = entry.text.substr(0, entry.text.find_first_of(" \t#"));
    if (!is_link_id(id))
      throw InputError(entry.place, {}, "is no id of a link",
                       "'catgs-server token' prints it beside the link, and the log names it");
    if (ids->insert(id).second && ids->size() > max_revoked_links)
      throw InputError(revoked_file_.source(), {},
                       fmt::format("more than {} links", max_revoked_links),
                       "leave out those that have expired, or change the key: that ends all links");
  }
  revoked_ = std::move(ids);
}

}  // namespace catgs
