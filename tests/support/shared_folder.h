#pragma once

#include <cstdlib>
#include <filesystem>

namespace catgs::test {

/// A folder of real scenes and traces, beside the source tree or where CATGS_SHARED_DIR says.
/// Empty: it is not there.
inline std::filesystem::path shared_folder(const std::filesystem::path& name) {
  const char* set = std::getenv("CATGS_SHARED_DIR");
  const std::filesystem::path folder =
      std::filesystem::path(set != nullptr ? set : CATGS_SOURCE_DIR "/../shared") / name;
  return std::filesystem::is_directory(folder) ? folder : std::filesystem::path();
}

}  // namespace catgs::test
