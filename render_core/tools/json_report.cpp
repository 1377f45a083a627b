#include "render_core/tools/json_report.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "render_core/base/part_file.h"

namespace catgs {

std::string json_text(const nlohmann::ordered_json& json) {
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

void check_json(const std::string& path) {
  if (!path.empty() && path != "-") check_writable(path);
}

void write_json(const std::string& path, const nlohmann::ordered_json& json) {
  if (path == "-") {
    fmt::print("{}\n", json_text(json));
    return;
  }
  PartFile file(path);
  file.stream() << json_text(json) << '\n';
  file.finish();
}

}  // namespace catgs
