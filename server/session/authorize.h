#pragma once

#include <functional>
#include <optional>
#include <string>

namespace catgs {

/// What somebody wants to do with a scene.
enum class Use {
  list,         // know that it is there
  own_session,  // move through it
  watch,        // look on at somebody's session, or be looked on at
  save,         // write its sidecar
};

/// Why a token does not admit to it, for people; nothing: it does.
using Authorize = std::function<std::optional<std::string>(const std::string& token,
                                                           const std::string& scene_id, Use use)>;

}  // namespace catgs
