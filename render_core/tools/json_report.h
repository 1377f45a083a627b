#pragma once

#include <string>

#include <nlohmann/json.hpp>

namespace catgs {

/// Indented text. JSON has to be UTF-8 and file names need not be: other bytes read U+FFFD.
std::string json_text(const nlohmann::ordered_json& json);

/// Throws InputError where write_json() could not begin, so that nobody measures in vain. An empty
/// path is none.
void check_json(const std::string& path);

/// Writes a report to a file, whole or not at all; "-" prints it. Throws InputError when it cannot
/// be written.
void write_json(const std::string& path, const nlohmann::ordered_json& json);

}  // namespace catgs
