#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include "render_core/base/error.h"
#include "render_core/scene/formats/file_set.h"
#include "tests/fuzz/target.h"

namespace catgs::fuzz {

/// Files of a folder one after the other: name, 0, size (3 bytes), content. A zip archive's
/// checksums would refuse nearly every mutant.
inline std::string packed(const std::map<std::string, std::string>& files) {
  std::string bytes;
  for (const auto& [name, content] : files) {
    const auto size = static_cast<std::uint32_t>(content.size());
    bytes.append(name).push_back('\0');
    bytes.append(reinterpret_cast<const char*>(&size), 3).append(content);
  }
  return bytes;
}

inline std::map<std::string, Bytes> unpacked(Bytes bytes) {
  std::map<std::string, Bytes> files;
  while (!bytes.empty()) {
    const auto name_end = std::find(bytes.begin(), bytes.end(), std::byte{0});
    const std::string name = text_of({bytes.begin(), name_end});
    bytes = bytes.subspan(std::min(bytes.size(), name.size() + 1));
    std::uint32_t size = 0;
    const std::size_t prefix = std::min<std::size_t>(3, bytes.size());
    std::memcpy(&size, bytes.data(), prefix);
    bytes = bytes.subspan(prefix);
    files[name] = bytes.first(std::min<std::size_t>(size, bytes.size()));
    bytes = bytes.subspan(files[name].size());
  }
  return files;
}

class PackedFiles : public FileSet {
 public:
  explicit PackedFiles(Bytes bytes) : files_(unpacked(bytes)) {}
  [[nodiscard]] std::unique_ptr<ByteSource> open(const std::string& name) const override {
    const auto found = files_.find(name);
    if (found == files_.end()) throw InputError(name, "", "is missing");
    return std::make_unique<MemorySource>(name, found->second);
  }

 private:
  std::map<std::string, Bytes> files_;
};

}  // namespace catgs::fuzz
