#include "render_core/scene/formats/byte_source.h"

#include <cerrno>
#include <system_error>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include "render_core/base/error.h"
#include "render_core/base/even_sample.h"

namespace catgs {

namespace {

std::string last_error() { return std::generic_category().message(errno); }

}  // namespace

void ByteSource::read(std::uint64_t offset, std::span<std::byte> to) const {
  if (to.size() > size_ || offset > size_ - to.size())
    throw InputError(
        name_, fmt::format("byte {}", offset),
        fmt::format("{} more bytes expected, but the file ends at byte {}", to.size(), size_),
        "the file is cut off or its header is wrong");
  read_in_range(offset, to);
}

std::vector<std::byte> ByteSource::read_all(std::uint64_t limit) const {
  if (size_ > limit)
    throw InputError(name_, "", fmt::format("{} bytes where at most {} make sense", size_, limit));
  std::vector<std::byte> bytes(size_);
  read(0, bytes);
  return bytes;
}

bool begins_with(const ByteSource& file, std::string_view bytes) {
  if (file.size() < bytes.size()) return false;
  std::string start(bytes.size(), '\0');
  file.read(0, std::as_writable_bytes(std::span(start)));
  return start == bytes;
}

std::vector<std::byte> read_rows(const ByteSource& file, std::uint64_t offset,
                                 std::size_t row_bytes, const FileRows& rows, std::size_t begin,
                                 std::size_t end) {
  std::vector<std::byte> bytes((end - begin) * row_bytes);
  // One read where the rows are neighbours.
  const std::size_t together = rows.step == 1 ? end - begin : 1;
  for (std::size_t i = begin; i < end; i += together)
    file.read(offset + (rows.first + EvenSample::number(i, rows.step)) * row_bytes,
              std::span(bytes).subspan((i - begin) * row_bytes, together * row_bytes));
  return bytes;
}

FileSource::Opened FileSource::open(const std::filesystem::path& path) {
  // O_NONBLOCK: opening a named pipe by mistake must not wait for a writer.
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (descriptor < 0) throw InputError(path.string(), "", "cannot be opened: " + last_error());
  struct stat info {};
  const bool known = ::fstat(descriptor, &info) == 0;
  if (!known || !S_ISREG(info.st_mode)) {
    const std::string why = known ? "is not a regular file" : "cannot be read: " + last_error();
    ::close(descriptor);
    throw InputError(path.string(), "", why);
  }
  return {descriptor, static_cast<std::uint64_t>(info.st_size)};
}

FileSource::FileSource(const std::filesystem::path& path) : FileSource(path, open(path)) {}

FileSource::FileSource(const std::filesystem::path& path, Opened opened)
    : ByteSource(path.string(), opened.size), descriptor_(opened.descriptor) {}

FileSource::~FileSource() { ::close(descriptor_); }

void FileSource::read_in_range(std::uint64_t offset, std::span<std::byte> to) const {
  while (!to.empty()) {
    const ssize_t got = ::pread(descriptor_, to.data(), to.size(), static_cast<off_t>(offset));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0)
      throw InputError(name(), fmt::format("byte {}", offset),
                       got == 0 ? "the file became shorter while it was read" : last_error());
    to = to.subspan(static_cast<std::size_t>(got));
    offset += static_cast<std::uint64_t>(got);
  }
}

void MemorySource::read_in_range(std::uint64_t offset, std::span<std::byte> to) const {
  if (!to.empty()) std::memcpy(to.data(), bytes_.data() + offset, to.size());
}

}  // namespace catgs
