#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace catgs {

/// The secrets of a welcome. Both are signed, not stored: every server with the same key can check
/// them, and a session keeps its id, and with it the links to watch it, when it moves to another
/// server.
class SessionTokens {
 public:
  explicit SessionTokens(std::string key) : key_(std::move(key)) {}

  struct Resumed {
    std::string session_id;
    std::string scene_id;  // that was shown
  };
  /// Continues the session on another connection.
  [[nodiscard]] std::string resume_token(std::string_view session_id, std::string_view scene_id,
                                         std::int64_t now_unix_s) const;
  /// Nothing: not signed with this key, or older than a day.
  [[nodiscard]] std::optional<Resumed> read_resume_token(std::string_view token,
                                                         std::int64_t now_unix_s) const;

  /// Lets others look on while the session lives.
  [[nodiscard]] std::string watch_token(std::string_view session_id) const;
  /// Its session id; nothing: not signed with this key.
  [[nodiscard]] std::optional<std::string> read_watch_token(std::string_view token) const;

 private:
  const std::string key_;
};

}  // namespace catgs
