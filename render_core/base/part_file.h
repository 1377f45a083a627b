#pragma once

#include <filesystem>
#include <fstream>

namespace catgs {

/// A file that is written whole or not at all. It carries the suffix `.part` until finish(), so a
/// failed write leaves the previous file in place. Pipes and devices are written directly. Throws
/// InputError.
class PartFile {
 public:
  explicit PartFile(const std::filesystem::path& path);
  ~PartFile();
  PartFile(const PartFile&) = delete;
  PartFile& operator=(const PartFile&) = delete;

  [[nodiscard]] std::ostream& stream() { return file_; }
  /// Renames the file to its final name.
  void finish();

 private:
  std::filesystem::path path_, target_, part_;
  std::ofstream file_;
};

/// Throws InputError where a PartFile of this name could not be opened. Call it before long work
/// whose result goes there. Changes nothing on disk.
void check_writable(const std::filesystem::path& path);

}  // namespace catgs
