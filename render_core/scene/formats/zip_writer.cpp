#include "render_core/scene/formats/zip_writer.h"

#include <memory>
#include <new>
#include <ostream>

#include <archive.h>
#include <archive_entry.h>

#include "render_core/base/error.h"

namespace catgs {

void write_zip(const std::map<std::string, std::string>& files, std::ostream& to) {
  const std::unique_ptr<archive, decltype(&archive_write_free)> zip(archive_write_new(),
                                                                    &archive_write_free);
  if (!zip) throw std::bad_alloc();
  const auto check = [&](la_ssize_t result) {
    if (result >= ARCHIVE_WARN) return;
    const char* why = archive_error_string(zip.get());
    throw InputError("", "archive", why ? why : "cannot be written");
  };
  check(archive_write_set_format_zip(zip.get()));
  check(archive_write_zip_set_compression_store(zip.get()));
  check(archive_write_set_bytes_per_block(zip.get(), 0));
  // A failed stream is noticed when the file is finished.
  const auto write = [](archive*, void* stream, const void* bytes, std::size_t size) {
    static_cast<std::ostream*>(stream)->write(static_cast<const char*>(bytes),
                                              static_cast<std::streamsize>(size));
    return static_cast<la_ssize_t>(size);
  };
  check(archive_write_open(zip.get(), &to, nullptr, write, nullptr));
  for (const auto& [name, content] : files) {
    const std::unique_ptr<archive_entry, decltype(&archive_entry_free)> entry(archive_entry_new(),
                                                                              &archive_entry_free);
    if (!entry) throw std::bad_alloc();
    archive_entry_set_pathname(entry.get(), name.c_str());
    archive_entry_set_filetype(entry.get(), AE_IFREG);
    archive_entry_set_perm(entry.get(), 0644);
    archive_entry_set_size(entry.get(), static_cast<la_int64_t>(content.size()));
    check(archive_write_header(zip.get(), entry.get()));
    check(archive_write_data(zip.get(), content.data(), content.size()));
  }
  check(archive_write_close(zip.get()));
}

}  // namespace catgs
