#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

namespace catgs {

/// A file without a name in the folder for temporary files (TMPDIR). It takes no place any more
/// when this object or the process is gone.
class ResultFile {
 public:
  /// Throws InputError where that folder cannot be written.
  ResultFile();
  ~ResultFile();
  ResultFile(const ResultFile&) = delete;
  ResultFile& operator=(const ResultFile&) = delete;

  /// Where it lies.
  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }
  /// A path by which this process can open the file.
  [[nodiscard]] std::string path() const;
  [[nodiscard]] std::uint64_t size() const;
  /// Fills `bytes` from that offset. False: they are not there. Any thread.
  bool read(std::uint64_t offset, std::span<std::byte> bytes) const;

 private:
  const std::filesystem::path folder_;
  int descriptor_;
};

}  // namespace catgs
