#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>

namespace catgs {

/// A way to use a scene. Access (access.h) decides which uses a token's role permits.
enum class Use {
  list,         // know that it is there
  own_session,  // move through it
  watch,        // watch a presenting session, or present
  save,         // write its sidecar
};

/// The reason of a refusal, for people; nothing: allowed.
using Refusal = std::optional<std::string>;

/// The rights of a token, as of when it was read. Checking a token takes time; asking a Permit
/// about each scene does not.
struct Permit {
  using Check = std::function<Refusal(std::string_view scene_id, Use use)>;

  [[nodiscard]] bool allows(std::string_view scene_id, Use use) const {
    return !check(scene_id, use).has_value();
  }
  /// The reason why `use` is refused; nothing if it is allowed.
  [[nodiscard]] Refusal refusal(std::string_view scene_id, Use use) const {
    return check(scene_id, use);
  }

  Check check;
  std::string link_id{};  // of a genuine link, even if it is refused; empty: the token is no link
  std::string
      token_id{};  // of a link or a static token, see Ended; empty: it has no right by itself
  std::int64_t expires_unix_s = std::numeric_limits<std::int64_t>::max();  // of a link
};
using Authorize = std::function<Permit(const std::string& token)>;

/// True if the token with this id has ended while the server runs: the link was revoked, or the
/// static token has left its file. Empty: true where nobody may see anything without a token.
using Ended = std::function<bool(std::string_view token_id)>;

using LinkIds = std::set<std::string, std::less<>>;
/// Ids of revoked links. Never null.
using RevokedLinks = std::shared_ptr<const LinkIds>;
inline constexpr std::string_view link_revoked = "this link was revoked: ask for a new one";

/// Returns the id of a link's scene. The link may contain the scene's name instead.
using ResolveScene = std::function<std::string(std::string_view name)>;

}  // namespace catgs
