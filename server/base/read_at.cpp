#include "server/base/read_at.h"

#include <cerrno>

#include <unistd.h>

namespace catgs {

std::size_t read_at(int descriptor, std::uint64_t offset, std::span<std::byte> bytes) {
  std::size_t filled = 0;
  while (filled < bytes.size()) {
    const std::span<std::byte> rest = bytes.subspan(filled);
    const ssize_t got =
        ::pread(descriptor, rest.data(), rest.size(), static_cast<off_t>(offset + filled));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) break;
    filled += static_cast<std::size_t>(got);
  }
  return filled;
}

}  // namespace catgs
