#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <string_view>
#include <utility>

namespace catgs {

/// The lock of a file, for processes that agree on it. It ends with this object, or with the
/// process.
class FileLock {
 public:
  /// Makes the file if it is missing. Waits so long for another holder, and no longer than anybody
  /// needs the lock. Throws std::system_error; its code is
  /// std::errc::resource_unavailable_try_again where another holder stays.
  explicit FileLock(
      const std::filesystem::path& file, std::chrono::milliseconds patience = {},
      const std::function<bool()>& is_needed = [] { return true; });
  FileLock(FileLock&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}
  FileLock& operator=(FileLock&&) = delete;
  ~FileLock();

 private:
  int descriptor_;
};

/// Makes a folder if needed, makes it this process's own by a lock of its file `name`, and removes
/// what killed writers have left in it. Throws InputError that names `setting` if the folder cannot
/// be written, or belongs to another process.
FileLock own_folder(std::string_view setting, const std::filesystem::path& folder,
                    std::string_view name);

}  // namespace catgs
