#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <utility>
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

/// The files of a folder in a set, for a file there that names others beside it. The set decides
/// which names lead out of it. Borrows the set.
class FilesBelow final : public FileSet {
 public:
  FilesBelow(const FileSet& files, std::filesystem::path folder)
      : files_(files), folder_(std::move(folder)) {}
  [[nodiscard]] std::unique_ptr<ByteSource> open(const std::string& name) const override {
    return files_.open(name_of(folder_, name));
  }
  [[nodiscard]] std::uint64_t packed_bytes() const override { return files_.packed_bytes(); }
  /// The name in the set of `name` in `folder`.
  static std::string name_of(const std::filesystem::path& folder, const std::string& name) {
    return (folder / name).lexically_normal().string();
  }

 private:
  const FileSet& files_;
  std::filesystem::path folder_;
};

/// The files of a scene while its parts are opened. Each file may be opened once: many parts that
/// share a few bytes could claim a scene of any size. Borrows the set.
class UnsharedFiles final : public FileSet {
 public:
  /// `scene`: the file that names the others, for error messages.
  UnsharedFiles(const FileSet& files, std::string scene)
      : files_(files), scene_(std::move(scene)) {}
  [[nodiscard]] std::unique_ptr<ByteSource> open(const std::string& name) const override;
  [[nodiscard]] std::uint64_t packed_bytes() const override { return files_.packed_bytes(); }
  /// The bytes of the files, but no more than their archive has.
  [[nodiscard]] std::uint64_t bytes() const { return std::min(bytes_, packed_bytes()); }

 private:
  const FileSet& files_;
  const std::string scene_;
  mutable std::set<std::string> names_;
  mutable std::uint64_t bytes_ = 0;
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
