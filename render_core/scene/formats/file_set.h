#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "render_core/scene/formats/byte_source.h"

namespace catgs {

/// The files of a scene that consists of several, by their names in its meta data.
class FileSet {
 public:
  FileSet() = default;
  virtual ~FileSet() = default;
  FileSet(const FileSet&) = delete;
  FileSet& operator=(const FileSet&) = delete;

  /// Throws InputError when there is no such file. The source must not outlive the set.
  [[nodiscard]] virtual std::unique_ptr<ByteSource> open(const std::string& name) const = 0;
  /// Size of the archive that the files were unpacked from; the largest number when there is none.
  /// Claims about a file's content are checked against this, because unpacked bytes may be nothing
  /// but zeros.
  [[nodiscard]] virtual std::uint64_t packed_bytes() const {
    return std::numeric_limits<std::uint64_t>::max();
  }
};

/// Files below a folder. Names that lead out of it are refused: they come from untrusted files.
class FolderFiles final : public FileSet {
 public:
  explicit FolderFiles(std::filesystem::path folder) : folder_(std::move(folder)) {}
  [[nodiscard]] std::unique_ptr<ByteSource> open(const std::string& name) const override;
  /// `name` below the folder. Throws InputError when it is absolute or contains ".." or a zero
  /// byte.
  [[nodiscard]] std::filesystem::path path_of(const std::string& name) const;

 private:
  std::filesystem::path folder_;
};

/// The entries of a zip archive, unpacked into memory. An archive may grow to at most four times
/// its size, and has at most 65,536 entries: scene archives hold images, which hardly compress.
class ZipFiles final : public FileSet {
 public:
  /// `only`: the one entry to unpack; empty: all. Throws InputError.
  explicit ZipFiles(const ByteSource& archive, std::string_view only = {});
  [[nodiscard]] std::unique_ptr<ByteSource> open(const std::string& name) const override;
  [[nodiscard]] std::uint64_t packed_bytes() const override { return packed_bytes_; }

 private:
  std::string name_;
  std::uint64_t packed_bytes_;
  std::map<std::string, std::vector<std::byte>> entries_;
};

}  // namespace catgs
