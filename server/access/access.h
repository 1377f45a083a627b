#pragma once

#include <chrono>
#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "server/access/authorize.h"
#include "server/access/list_file.h"
#include "server/access/signed_token.h"

namespace catgs {

/// The rights of an expiring link.
struct LinkGrant {
  std::string scene_id;  // or a name, which means the scene that has it alone; empty: every scene
  /// "viewer": may look at everything; "author": may also save tours; "spectator": only watch
  /// those who present; "solo": neither watch nor present.
  std::string role = "viewer";
  std::int64_t expires_unix_s = 0;
  std::string id = {};  // by which it can be revoked; empty: made when links had none
};

/// Returns an id for a new link.
std::string new_link_id();

/// Makes a token `payload.mac`, both base64url: the grant in clear and its HMAC-SHA256 under `key`.
/// Every server with the key can check it. Throws InputError on a bad role, scene or id.
std::string make_link_token(const LinkGrant& grant, std::string_view key);
/// Returns the grant if the token was made with `key`. Its expiry is not checked. A link without an
/// id is known by the beginning of its digest.
std::optional<LinkGrant> read_link_token(std::string_view token, std::string_view key);

/// Reads a key of at least 16 bytes, without trailing line ends. Throws InputError that names the
/// flag of the path.
std::string read_key_file(std::string_view flag, const std::filesystem::path& path);

/// The key of what a server signs for its own clients: of the first file that is given, or random.
/// Servers of a fleet have it in common.
std::string read_own_key(const std::filesystem::path& resume_key_file,
                         const std::filesystem::path& token_key_file);

/// "90s", "30m", "12h", "7d". Throws InputError.
std::chrono::seconds parse_duration(std::string_view text);

/// Decides who may see which scene. Without a token file and a key file, everybody may see all
/// scenes. Where access is open, so may everybody who comes without a token. Only links of role
/// "author" may change files in scenes' folders. Thread-safe.
class AccessControl {
 public:
  /// An empty path disables that kind of token. `own_key`: of what the server signs for its
  /// own clients; servers of a fleet share it. Throws InputError if a file cannot be read.
  AccessControl(std::filesystem::path token_file, const std::filesystem::path& key_file,
                bool open = false, std::filesystem::path revoked_links = {},
                std::string own_key = random_key());

  /// Returns what `token` permits. `resolve` gives the id of the scene that it names. The files of
  /// tokens and of revoked links are reread after a change; if that fails, the last valid content
  /// stays in force.
  Permit permit(std::string_view token, std::int64_t now_unix_s, const ResolveScene& resolve);

  /// Returns the links that are revoked by now.
  RevokedLinks revoked_links();
  [[nodiscard]] const std::string& own_key() const { return own_key_; }
  /// See Ended.
  bool ended(std::string_view token_id);

 private:
  /// Returns the grant of a valid token, or why it is invalid. Fills in the ids of `permit`.
  std::variant<LinkGrant, std::string> read(std::string_view token, std::int64_t now_unix_s,
                                            Permit& permit);
  void read_token_file();
  void read_revoked_links();
  struct StaticToken {
    TokenDigest digest;
    std::string id;
  };
  /// The tokens of the file by now. The mutex is held.
  const std::vector<StaticToken>& static_tokens();
  /// Returns the id of a static token; empty: it is none.
  std::string id_of_static(std::string_view token);

  const bool open_;
  const std::string own_key_;
  std::mutex mutex_;
  ListFile token_file_;
  std::vector<StaticToken> tokens_;
  ListFile revoked_file_;
  RevokedLinks revoked_ = std::make_shared<LinkIds>();
  std::string key_;  // not changed once constructed
};

}  // namespace catgs
