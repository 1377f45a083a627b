#include "render_core/base/part_file.h"

#include <string_view>
#include <system_error>

#include "render_core/base/error.h"

namespace catgs {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(const fs::path& path, std::string_view why) {
  throw InputError(path.string(), "", why, "does the folder exist, and is there space?");
}

/// Neither a file nor a folder: a pipe or a device, which must not be replaced by a file.
bool is_special(const fs::path& path) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  return fs::exists(status) && !fs::is_regular_file(status) && !fs::is_directory(status);
}

/// The target of a symbolic link, so that the link itself survives.
fs::path without_links(const fs::path& path) {
  std::error_code error;
  fs::path target = fs::canonical(path, error);
  return error ? path : target;
}

}  // namespace

PartFile::PartFile(const fs::path& path) : path_(path), target_(without_links(path)) {
  std::error_code error;
  if (fs::is_directory(target_, error)) fail(path_, "is a folder");
  part_ = target_;
  if (!is_special(target_)) part_ += ".part";
  file_.open(part_, std::ios::binary | std::ios::trunc);
  if (!file_) fail(path_, "cannot be written");
}

PartFile::~PartFile() {
  file_.close();
  std::error_code ignored;
  if (part_ != target_) fs::remove(part_, ignored);
}

void PartFile::finish() {
  file_.close();
  if (!file_) fail(path_, "cannot be written");
  if (part_ == target_) return;
  std::error_code error;
  fs::rename(part_, target_, error);
  if (error) fail(path_, error.message());
  part_ = target_;
}

void check_writable(const fs::path& path) {
  if (!is_special(path)) PartFile{path};  // opening a pipe would wait for its reader
}

}  // namespace catgs
