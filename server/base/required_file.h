#pragma once

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <system_error>

#include "render_core/base/error.h"

namespace catgs {

/// Opens a file that a setting names ("--tls-key"). Throws InputError that names both and says why
/// it cannot be read.
inline std::ifstream open_required_file(std::string_view flag, const std::filesystem::path& path) {
  const auto fail = [&](const std::string& why) {
    throw InputError(std::string(flag) + " " + path.string(), {}, "cannot be read: " + why,
                     "check the path and that the server's user may read the file");
  };
  std::error_code ignored;
  const auto status = std::filesystem::status(path, ignored);
  if (std::filesystem::is_directory(status)) fail("it is a folder");
  // Opening a named pipe waits for a writer.
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status))
    fail("it is not a regular file");
  std::ifstream in(path, std::ios::binary);
  if (!in) fail(std::generic_category().message(errno));
  return in;
}

}  // namespace catgs
