#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "server/access/authorize.h"

namespace catgs {

/// The tokens in a welcome. They are signed, not stored, so every server with the same key can
/// check them. A session that moves to another server therefore keeps its id and its watch links.
class SessionTokens {
 public:
  explicit SessionTokens(std::string key) : key_(std::move(key)) {}

  struct Resumed {
    std::string session_id;
    std::string scene_id;  // that was shown
  };
  /// A token that continues the session on another connection.
  [[nodiscard]] std::string resume_token(std::string_view session_id, std::string_view scene_id,
                                         std::int64_t now_unix_s) const;
  /// Returns nothing if the token was not signed with this key or is older than a day.
  [[nodiscard]] std::optional<Resumed> read_resume_token(std::string_view token,
                                                         std::int64_t now_unix_s) const;

  /// A token that lets spectators watch while the session lives.
  [[nodiscard]] std::string watch_token(std::string_view session_id) const;
  /// Returns the session's id; nothing: not signed with this key.
  [[nodiscard]] std::optional<std::string> read_watch_token(std::string_view token) const;

  /// A pass to the scene's tours and media, for some hours and no longer than `permit` lasts. It
  /// may be part of an address, because elements of a page cannot send a token.
  [[nodiscard]] std::string scene_pass(std::string_view scene_id, const Permit& permit,
                                       std::int64_t now_unix_s) const;
  /// Returns the id of the token that the pass was made for, which may have ended; nothing: it is
  /// no pass to this scene, or it is over.
  [[nodiscard]] std::optional<std::string> read_scene_pass(std::string_view pass,
                                                           std::string_view scene_id,
                                                           std::int64_t now_unix_s) const;

 private:
  const std::string key_;
};

}  // namespace catgs
