#include "server/base/result_file.h"

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <string_view>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include "render_core/base/error.h"
#include "server/base/read_at.h"

namespace catgs {
namespace {

constexpr std::string_view remedy = "give TMPDIR a folder that can be written";

std::string temporary_folder() {
  const char* const given = std::getenv("TMPDIR");
  return given && *given ? given : "/tmp";
}

}  // namespace

ResultFile::ResultFile() : folder_(temporary_folder()) {
  std::string name = (folder_ / "catgs-XXXXXX").string();
  descriptor_ = ::mkostemp(name.data(), O_CLOEXEC);
  if (descriptor_ < 0)
    throw InputError("TMPDIR " + folder_.string(), {}, std::strerror(errno), remedy);
  ::unlink(name.c_str());
}

ResultFile::~ResultFile() { ::close(descriptor_); }

std::string ResultFile::path() const { return fmt::format("/proc/self/fd/{}", descriptor_); }

std::uint64_t ResultFile::size() const {
  struct stat status {};
  return ::fstat(descriptor_, &status) == 0 ? static_cast<std::uint64_t>(status.st_size) : 0;
}

bool ResultFile::read(std::uint64_t offset, std::span<std::byte> bytes) const {
  return read_at(descriptor_, offset, bytes) == bytes.size();
}

}  // namespace catgs
