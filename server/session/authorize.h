#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>

namespace catgs {

/// What somebody wants to do with a scene.
enum class Use {
  list,         // know that it is there
  own_session,  // move through it
  watch,        // look on at somebody's session, or be looked on at
  save,         // write its sidecar
};

/// Why it is refused, for people; nothing: it is not.
using Refusal = std::optional<std::string>;

/// What a token admits to at the moment it was read. Checking a token takes its time, asking a
/// Permit about scene after scene does not.
using Permit = std::function<Refusal(std::string_view scene_id, Use use)>;
using Authorize = std::function<Permit(const std::string& token)>;

}  // namespace catgs
