#include "server/access/session_tokens.h"

#include <algorithm>
#include <charconv>

#include <fmt/format.h>

#include "server/access/signed_token.h"

namespace catgs {
namespace {

constexpr std::string_view resume_purpose = "catgs-resume-v1";
constexpr std::string_view watch_purpose = "catgs-watch-v1";
constexpr std::string_view pass_purpose = "catgs-media-v1";
constexpr std::int64_t resume_valid_s = 24 * 3600;
constexpr std::int64_t pass_valid_s = 4 * 3600;

}  // namespace

std::string SessionTokens::resume_token(std::string_view session_id, std::string_view scene_id,
                                        std::int64_t now_unix_s) const {
  // The scene's id comes last: it is the only part that may hold a colon.
  return sign_token(resume_purpose, fmt::format("{}:{}:{}", session_id, now_unix_s, scene_id),
                    key_);
}

std::optional<SessionTokens::Resumed> SessionTokens::read_resume_token(
    std::string_view token, std::int64_t now_unix_s) const {
  const auto payload = read_signed_token(resume_purpose, token, key_);
  if (!payload) return std::nullopt;
  const auto id_end = payload->find(':');
  const auto time_end = payload->find(':', id_end + 1);
  if (id_end == std::string::npos || time_end == std::string::npos) return std::nullopt;
  std::int64_t issued_unix_s = 0;
  std::from_chars(payload->data() + id_end + 1, payload->data() + time_end, issued_unix_s);
  if (issued_unix_s < now_unix_s - resume_valid_s) return std::nullopt;
  return Resumed{payload->substr(0, id_end), payload->substr(time_end + 1)};
}

std::string SessionTokens::watch_token(std::string_view session_id) const {
  return sign_token(watch_purpose, session_id, key_);
}

std::optional<std::string> SessionTokens::read_watch_token(std::string_view token) const {
  return read_signed_token(watch_purpose, token, key_);
}

std::string SessionTokens::scene_pass(std::string_view scene_id, const Permit& permit,
                                      std::int64_t now_unix_s) const {
  const std::int64_t end_s = std::min(now_unix_s + pass_valid_s, permit.expires_unix_s);
  return sign_token(pass_purpose, fmt::format("{}\n{}\n{}", scene_id, end_s, permit.token_id),
                    key_);
}

std::optional<std::string> SessionTokens::read_scene_pass(std::string_view pass,
                                                          std::string_view scene_id,
                                                          std::int64_t now_unix_s) const {
  const auto payload = read_signed_token(pass_purpose, pass, key_);
  if (!payload || !payload->starts_with(std::string(scene_id) + "\n")) return std::nullopt;
  const std::string_view rest = std::string_view(*payload).substr(scene_id.size() + 1);
  std::int64_t end_s = 0;
  const auto [stop, error] = std::from_chars(rest.data(), rest.data() + rest.size(), end_s);
  const std::string_view token = rest.substr(static_cast<std::size_t>(stop - rest.data()));
  if (error != std::errc() || !token.starts_with('\n') || now_unix_s >= end_s) return std::nullopt;
  return std::string(token.substr(1));
}

}  // namespace catgs
