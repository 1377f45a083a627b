#pragma once

#include <filesystem>
#include <fstream>
#include <optional>

#include "render_core/base/new_file.h"

namespace catgs {

/// A file that is written whole or not at all: a failed write leaves the previous file in place,
/// and writers of one path do not meet. Throws InputError.
class PartFile {
 public:
  /// The meaning of a path that names a link, a pipe or a device. Opening a pipe waits for its
  /// reader.
  enum class Special {
    written,   // the link's target is replaced; pipes and devices are written directly
    replaced,  // the file takes its place, which never waits
  };

  explicit PartFile(const std::filesystem::path& path, Special special = Special::written);

  [[nodiscard]] std::ostream& stream() { return file_; }
  /// Gives the file its name.
  void finish();

 private:
  const std::filesystem::path path_;
  std::optional<NewFile> fresh_;  // nothing: the path is written directly
  std::ofstream file_;
};

/// Throws InputError where a PartFile of this name could not be opened. Call it before long work
/// whose result goes there. Changes nothing on disk.
void check_writable(const std::filesystem::path& path);

}  // namespace catgs
