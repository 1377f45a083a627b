#include "tests/fuzz/corpus.h"

#include <cerrno>
#include <memory>
#include <stdexcept>
#include <system_error>

#include <archive.h>
#include <archive_entry.h>
#include <fcntl.h>
#include <unistd.h>

namespace catgs::fuzz {

std::vector<std::string> read_corpus(const std::filesystem::path& archive) {
  const std::unique_ptr<struct archive, decltype(&archive_read_free)> reader(archive_read_new(),
                                                                             archive_read_free);
  archive_read_support_format_tar(reader.get());
  archive_read_support_filter_gzip(reader.get());
  const auto check = [&](la_ssize_t result) {
    if (result >= 0) return;
    const char* why = archive_error_string(reader.get());
    throw std::runtime_error(archive.string() + ": " + (why ? why : "not readable"));
  };
  check(archive_read_open_filename(reader.get(), archive.c_str(), 65536));
  std::vector<std::string> inputs;
  archive_entry* entry = nullptr;
  for (;;) {
    const int result = archive_read_next_header(reader.get(), &entry);
    check(result);
    if (result == ARCHIVE_EOF) return inputs;
    if (archive_entry_filetype(entry) != AE_IFREG) continue;
    std::string bytes(static_cast<std::size_t>(archive_entry_size(entry)), '\0');
    const la_ssize_t read = archive_read_data(reader.get(), bytes.data(), bytes.size());
    check(read);
    if (static_cast<std::size_t>(read) != bytes.size())
      throw std::runtime_error(archive.string() + ": ends within " + archive_entry_pathname(entry));
    inputs.push_back(std::move(bytes));
  }
}

KeptInput::KeptInput(const std::filesystem::path& path) : path_(path) {
  std::filesystem::create_directories(path.parent_path());
  descriptor_ = ::open(path.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (descriptor_ < 0) throw std::system_error(errno, std::generic_category(), path.string());
}

KeptInput::~KeptInput() {
  ::close(descriptor_);
  std::error_code ignored;
  if (!leaves_) std::filesystem::remove(path_, ignored);
}

void KeptInput::keep(const std::string& input) {
  if (::ftruncate(descriptor_, 0) != 0 ||
      ::pwrite(descriptor_, input.data(), input.size(), 0) != static_cast<ssize_t>(input.size()))
    throw std::system_error(errno, std::generic_category(), path_.string());
}

}  // namespace catgs::fuzz
