#include "render_core/tools/json_report.h"

#include <fstream>

#include <fmt/format.h>

#include "render_core/error.h"

namespace catgs {

std::string json_text(const nlohmann::ordered_json& json) {
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

void write_json(const std::string& path, const nlohmann::ordered_json& json) {
  if (path == "-") {
    fmt::print("{}\n", json_text(json));
    return;
  }
  std::ofstream file(path);
  file << json_text(json) << std::endl;
  if (!file) throw InputError(path, "", "cannot be written", "does the folder exist?");
}

}  // namespace catgs
