#pragma once

#include <chrono>
#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "server/session/authorize.h"
#include "server/signed_token.h"

namespace catgs {

/// What an expiring link allows.
struct LinkGrant {
  std::string scene_id;  // empty: every scene
  /// "viewer": may look at everything; "author": may also save tours; "spectator": only watch
  /// others' sessions; "solo": neither watch nor be watched.
  std::string role = "viewer";
  std::int64_t expires_unix_s = 0;
};

/// `payload.mac`, both base64url: the grant in clear and its HMAC-SHA256 under `key`, so that every
/// server with the key can check it. Throws InputError on a bad role or scene.
std::string make_link_token(const LinkGrant& grant, std::string_view key);
/// The grant, if the token was made with `key`; says nothing about its expiry.
std::optional<LinkGrant> read_link_token(std::string_view token, std::string_view key);

/// Reads a key of at least 16 bytes; trailing line ends are not part of it. Throws InputError that
/// names the flag which gave the path.
std::string read_key_file(std::string_view flag, const std::filesystem::path& path);

/// "90s", "30m", "12h", "7d". Throws InputError.
std::chrono::seconds parse_duration(std::string_view text);

/// Who may see which scene. Without a token file and a key file: everybody, all. What is in scenes'
/// folders is changed by links of role "author" alone. Thread-safe.
class AccessControl {
 public:
  /// Empty path: this kind of token is not used. Throws InputError when a file cannot be read.
  AccessControl(std::filesystem::path token_file, const std::filesystem::path& key_file);

  /// What `token` admits to. The token file is read again when it has changed; when that fails, its
  /// last good content stays in force.
  Permit permit(std::string_view token, std::int64_t now_unix_s);

 private:
  /// The grant of a token that is good, or why it is not.
  std::variant<LinkGrant, std::string> resolve(std::string_view token, std::int64_t now_unix_s);
  void reload_when_changed();
  void read_token_file();
  bool is_static_token(std::string_view token);

  std::mutex mutex_;
  const std::filesystem::path token_file_;
  std::filesystem::file_time_type token_file_time_{};
  std::vector<TokenDigest> tokens_;
  std::string key_;  // not changed once constructed
};

}  // namespace catgs
