#pragma once

#include <chrono>
#include <filesystem>

namespace catgs {

/// A file that takes the place of another one when it is whole. Writers of one target do not meet,
/// in one process or in several: the file has no name, or a random one. It goes with the process,
/// except where the file system knows no files without a name.
class NewFile {
 public:
  /// It lies in the folder of `target`. Throws std::system_error.
  explicit NewFile(std::filesystem::path target);
  ~NewFile();
  NewFile(const NewFile&) = delete;
  NewFile& operator=(const NewFile&) = delete;

  [[nodiscard]] int descriptor() const { return descriptor_; }
  /// A path by which this process can open it.
  [[nodiscard]] std::filesystem::path path() const;
  /// Replaces the target, whatever that is. A reader finds the complete old or new file. Throws
  /// std::system_error, and the target is as it was.
  void become_target();

 private:
  const std::filesystem::path target_;
  const std::filesystem::path name_;
  int descriptor_ = -1;
  bool named_ = false;  // it is found under name_
};

/// True for the name of a file that is being written, or that a killed writer has left.
bool is_name_of_new_file(const std::filesystem::path& file);

/// Removes what killed writers have left in the folder: files that nobody has written to for so
/// long. An unreadable folder is left alone.
void remove_stale_files(const std::filesystem::path& folder, std::chrono::hours unchanged_for);

/// After so long nobody writes to such a file any more, on another machine either.
inline constexpr std::chrono::hours surely_stale{24};

}  // namespace catgs
