#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <string_view>

#include "render_core/base/error.h"
#include "render_core/base/new_file.h"
#include "server/base/file_lock.h"

namespace catgs {

inline constexpr std::string_view beside_the_scene =
    "download the file, and let the operator put it beside the scene";

/// A new content of a file, on the disk already, even after a power cut. It is dropped unless it
/// takes its place. Throws InputError with the remedy, and then nothing has changed.
class Replacement {
 public:
  Replacement(const std::filesystem::path& file, std::string_view content, std::string_view remedy);

  /// A reader finds the complete old or new content.
  void take_place();
  /// The same, but keeps the old file with `.bak` appended to its name, in place of an earlier one.
  void take_place_and_keep_old();

 private:
  const std::filesystem::path file_;
  const std::string_view remedy_;
  NewFile fresh_;
};

/// A Replacement at once.
void overwrite_file(const std::filesystem::path& file, std::string_view content,
                    std::string_view remedy);

/// Another server saves in the folder and does not end.
struct FolderBusy : InputError {
  using InputError::InputError;
};

/// The lock for saves in a folder, which servers over one folder take in turn. Hold it from the
/// look at a file until another one has its place. Throws FolderBusy after `patience`, or when the
/// lock is not needed any more, and InputError with the remedy where the lock's file cannot be
/// made.
inline constexpr std::chrono::seconds save_patience{5};
FileLock lock_for_saving(
    const std::filesystem::path& folder, std::chrono::milliseconds patience = save_patience,
    const std::function<bool()>& is_needed = [] { return true; });

}  // namespace catgs
