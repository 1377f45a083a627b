#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>

namespace catgs {

/// A way to use a scene. Access (access.h) decides which uses a token's role permits.
enum class Use {
  list,         // know that it is there
  own_session,  // move through it
  watch,        // look on at somebody's session, or be looked on at
  save,         // write its sidecar
};

/// The reason of a refusal, for people; nothing: allowed.
using Refusal = std::optional<std::string>;

/// Answers what a token permits, as of when it was read. Checking a token takes time; asking a
/// Permit about each scene does not.
using Permit = std::function<Refusal(std::string_view scene_id, Use use)>;
using Authorize = std::function<Permit(const std::string& token)>;

/// Returns the id of a link's scene. The link may contain the scene's name instead.
using ResolveScene = std::function<std::string(std::string_view wish)>;

}  // namespace catgs
