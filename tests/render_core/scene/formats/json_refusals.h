#pragma once

#include <functional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "tests/render_core/scene/scene_test_support.h"

namespace catgs::test {

/// A change of a JSON document that its reader refuses, and what the error names.
struct JsonRefusal {
  std::string pointer;  // to the value that is changed
  nlohmann::json value;
  std::string where;
  std::string source{};  // empty: that of the document
};

/// The value is taken out of the document.
inline const nlohmann::json removed(nlohmann::json::value_t::discarded);

/// Makes each change alone. `source`: the name of the document.
inline void expect_refused(const nlohmann::json& document, const std::string& source,
                           const std::function<void(const nlohmann::json&)>& read,
                           const std::vector<JsonRefusal>& refusals) {
  for (const JsonRefusal& refusal : refusals) {
    SCOPED_TRACE(refusal.pointer + " = " +
                 (refusal.value.is_discarded() ? "removed" : refusal.value.dump().substr(0, 80)));
    nlohmann::json changed = document;
    if (refusal.value.is_discarded())
      changed.patch_inplace({{{"op", "remove"}, {"path", refusal.pointer}}});
    else
      changed[nlohmann::json::json_pointer(refusal.pointer)] = refusal.value;
    EXPECT_EQ(refusal_of([&] { read(changed); }),
              (Refusal{refusal.source.empty() ? source : refusal.source, refusal.where}));
  }
}

}  // namespace catgs::test
