#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

namespace catgs {

/// Random-access bytes for the readers: a file, or a buffer in memory (archive entries, tests,
/// fuzzers). `read` may be called from several threads.
///
/// Files are read with pread, not mapped. A training run may truncate the file while a server reads
/// it, which must be an error message and not a SIGBUS. Mapped pages would also count as a second
/// copy of the scene in memory.
class ByteSource {
 public:
  ByteSource(std::string name, std::uint64_t size) : name_(std::move(name)), size_(size) {}
  virtual ~ByteSource() = default;
  ByteSource(const ByteSource&) = delete;
  ByteSource& operator=(const ByteSource&) = delete;

  [[nodiscard]] const std::string& name() const { return name_; }  // for error messages
  [[nodiscard]] std::uint64_t size() const { return size_; }

  /// Fills `to` with the bytes from `offset`. Throws InputError naming the offset where the range
  /// reaches beyond the end or cannot be read.
  void read(std::uint64_t offset, std::span<std::byte> to) const;

  /// The whole content. Throws InputError when it is larger than `limit` bytes.
  [[nodiscard]] std::vector<std::byte> read_all(std::uint64_t limit) const;

 private:
  virtual void read_in_range(std::uint64_t offset, std::span<std::byte> to) const = 0;

  std::string name_;
  std::uint64_t size_;
};

/// Whether the first bytes of a file are these.
bool begins_with(const ByteSource& file, std::string_view bytes);

/// Some rows of a file of rows: `count` of them from `first` on; with a `step`, an EvenSample.
struct FileRows {
  std::uint64_t first = 0, count = 0, step = 1;
};

/// The bytes of rows [begin, end) among `rows`. The file's rows have `row_bytes` each, and the
/// first one starts at byte `offset`. Throws InputError as ByteSource::read() does.
std::vector<std::byte> read_rows(const ByteSource& file, std::uint64_t offset,
                                 std::size_t row_bytes, const FileRows& rows, std::size_t begin,
                                 std::size_t end);

class FileSource final : public ByteSource {
 public:
  /// Throws InputError when the file cannot be opened or is not a regular file.
  explicit FileSource(const std::filesystem::path& path);
  ~FileSource() override;

 private:
  struct Opened {
    int descriptor;
    std::uint64_t size;
  };
  static Opened open(const std::filesystem::path& path);
  FileSource(const std::filesystem::path& path, Opened opened);
  void read_in_range(std::uint64_t offset, std::span<std::byte> to) const override;

  int descriptor_;
};

/// Borrows `bytes`, which must outlive the source.
class MemorySource final : public ByteSource {
 public:
  MemorySource(std::string name, std::span<const std::byte> bytes)
      : ByteSource(std::move(name), bytes.size()), bytes_(bytes) {}

 private:
  void read_in_range(std::uint64_t offset, std::span<std::byte> to) const override;

  std::span<const std::byte> bytes_;
};

/// `size` bytes of another source from `offset` on. Borrows it.
class SliceSource final : public ByteSource {
 public:
  /// The bytes must be there.
  SliceSource(const ByteSource& whole, std::uint64_t offset, std::uint64_t size)
      : ByteSource(whole.name(), size), whole_(whole), offset_(offset) {}

 private:
  void read_in_range(std::uint64_t offset, std::span<std::byte> to) const override {
    whole_.read(offset_ + offset, to);
  }

  const ByteSource& whole_;
  std::uint64_t offset_;
};

static_assert(std::endian::native == std::endian::little,
              "scene files are little-endian and are copied without swapping");

/// The value stored at `from`, which need not be aligned.
template <class T>
T load_as(const std::byte* from) {
  static_assert(std::is_trivially_copyable_v<T>);
  T value;
  std::memcpy(&value, from, sizeof value);
  return value;
}

}  // namespace catgs
