#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

namespace catgs {

/// Indented text. JSON must be UTF-8, but file names need not be: other bytes become U+FFFD.
std::string json_text(const nlohmann::ordered_json& json);

/// Throws InputError where write_json() could not begin, so that no measurement is made in vain. An
/// empty path is ignored.
void check_json(const std::string& path);

/// Writes a report to a file, whole or not at all; "-" prints it. Throws InputError when it cannot
/// be written.
void write_json(const std::string& path, const nlohmann::ordered_json& json);

}  // namespace catgs
