#include "render_core/scene/formats/file_set.h"

#include <algorithm>
#include <string_view>

#include <archive.h>
#include <archive_entry.h>
#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/base/printable.h"

namespace catgs {

namespace {

constexpr std::size_t max_entries = std::size_t{1}
                                    << 16;  // a SOG has nine, a streamed one thousands

/// libarchive's callbacks over a ByteSource. They must not throw through C, so a failed read is
/// kept and thrown afterwards.
struct ArchiveInput {
  const ByteSource& file;
  std::uint64_t next = 0;
  std::vector<std::byte> buffer = std::vector<std::byte>(256 * 1024);
  std::exception_ptr failure{};

  static la_ssize_t read(archive*, void* self, const void** data) {
    auto& input = *static_cast<ArchiveInput*>(self);
    const auto piece =
        std::span(input.buffer)
            .first(std::min<std::uint64_t>(input.buffer.size(), input.file.size() - input.next));
    try {
      input.file.read(input.next, piece);
    } catch (...) {
      input.failure = std::current_exception();
      return ARCHIVE_FATAL;
    }
    input.next += piece.size();
    *data = piece.data();
    return static_cast<la_ssize_t>(piece.size());
  }

  static la_int64_t seek(archive*, void* self, la_int64_t offset, int whence) {
    auto& input = *static_cast<ArchiveInput*>(self);
    const auto size = static_cast<la_int64_t>(input.file.size());
    const auto from = whence == SEEK_SET   ? 0
                      : whence == SEEK_CUR ? static_cast<la_int64_t>(input.next)
                                           : size;
    input.next = static_cast<std::uint64_t>(std::clamp<la_int64_t>(from + offset, 0, size));
    return static_cast<la_int64_t>(input.next);
  }
};

std::string_view why(archive* zip) {
  const char* message = archive_error_string(zip);
  return message ? message : "cannot be unpacked";
}

/// `piece`: buffer that the bytes pass through.
std::vector<std::byte> unpack_entry(archive* zip, std::uint64_t limit, const ByteSource& file,
                                    const std::string& name, std::span<std::byte> piece) {
  std::vector<std::byte> bytes;
  for (;;) {
    const la_ssize_t got = archive_read_data(zip, piece.data(), piece.size());
    if (got < 0) throw InputError(file.name(), "entry " + name, why(zip), "the archive is damaged");
    if (got == 0) return bytes;
    if (bytes.size() + static_cast<std::size_t>(got) > limit)
      throw InputError(file.name(), "entry " + name, "unpacks to more than a scene can hold");
    bytes.insert(bytes.end(), piece.begin(), piece.begin() + got);
  }
}

}  // namespace

std::filesystem::path FolderFiles::path_of(const std::string& name) const {
  const std::filesystem::path relative(name);
  const bool leaves = std::find(relative.begin(), relative.end(), "..") != relative.end();
  const auto refuse = [&](std::string_view what) {
    throw InputError(folder_.string(), "file name '" + printable(name) + "'", what);
  };
  if (name.empty() || relative.is_absolute() || leaves) refuse("leads out of the folder");
  // The system would read the name up to the zero byte only.
  if (name.find('\0') != std::string::npos) refuse("has a zero byte");
  return folder_ / relative;
}

std::unique_ptr<ByteSource> FolderFiles::open(const std::string& name) const {
  return std::make_unique<FileSource>(path_of(name));
}

std::unique_ptr<ByteSource> UnsharedFiles::open(const std::string& name) const {
  if (!names_.insert(std::filesystem::path(name).lexically_normal().string()).second)
    throw InputError(scene_, "file " + printable(name), "is used a second time",
                     "give each part of the scene files of its own");
  auto file = files_.open(name);
  bytes_ += file->size();
  return file;
}

ZipFiles::ZipFiles(const ByteSource& file, std::string_view only)
    : name_(file.name()), packed_bytes_(file.size()) {
  ArchiveInput input{file};
  const std::unique_ptr<archive, decltype(&archive_read_free)> zip(archive_read_new(),
                                                                   &archive_read_free);
  if (!zip) throw std::bad_alloc();
  archive_read_support_format_zip_seekable(zip.get());
  archive_read_set_read_callback(zip.get(), &ArchiveInput::read);
  archive_read_set_seek_callback(zip.get(), &ArchiveInput::seek);
  archive_read_set_callback_data(zip.get(), &input);

  const auto check = [&](int result) {
    if (result >= ARCHIVE_WARN) return;
    if (input.failure) std::rethrow_exception(input.failure);
    throw InputError(file.name(), "", why(zip.get()), "the archive is damaged");
  };
  check(archive_read_open1(zip.get()));
  std::uint64_t room = 4 * file.size() + (1 << 20);
  std::vector<std::byte> piece(256 * 1024);
  for (std::size_t count = 1;; ++count) {
    archive_entry* entry = nullptr;
    const int result = archive_read_next_header(zip.get(), &entry);
    if (result == ARCHIVE_EOF) break;
    check(result);
    if (count > max_entries)
      throw InputError(file.name(), "", fmt::format("holds more than {} entries", max_entries));
    const char* entry_name = archive_entry_pathname(entry);
    const std::string name = entry_name ? entry_name : "";
    if (!only.empty() && name != only) continue;
    std::vector<std::byte> bytes = unpack_entry(zip.get(), room, file, name, piece);
    room -= bytes.size();
    entries_[name] = std::move(bytes);
  }
}

std::unique_ptr<ByteSource> ZipFiles::open(const std::string& name) const {
  const auto found = entries_.find(name);
  if (found == entries_.end()) throw InputError(name_, "entry " + name, "is missing");
  return std::make_unique<MemorySource>(name_ + "/" + name, found->second);
}

}  // namespace catgs
