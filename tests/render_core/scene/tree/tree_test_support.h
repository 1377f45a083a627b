#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <functional>
#include <memory>
#include <numeric>
#include <span>
#include <string>

#include "render_core/scene/tree/build_tree.h"
#include "render_core/scene/tree/tree_file.h"
#include "tests/support/picked.h"
#include "tests/support/temporary_folder.h"

namespace catgs::test {

/// The bytes of the cloud's tree. `part`: Gaussians of a part.
inline std::string tree_bytes(const GaussianCloud& cloud, ThreadPool& pool,
                              std::size_t memory_bytes = std::size_t{1} << 30,
                              std::size_t part = 1'000'000) {
  const auto each = [&](const std::function<void(const GaussianCloud&)>& take) {
    for (std::size_t first = 0; first < cloud.size(); first += part) {
      std::vector<std::uint32_t> some(std::min(part, cloud.size() - first));
      std::iota(some.begin(), some.end(), static_cast<std::uint32_t>(first));
      take(picked(cloud, some));
    }
    return std::uint64_t{3};  // dropped
  };
  const TemporaryFolder folder;
  build_tree({each, "test"}, folder / "a.tree", memory_bytes, pool, LoadContext(pool));
  return content_of(folder / "a.tree");
}

/// A file in memory that owns its bytes.
class OwnedSource final : public ByteSource {
 public:
  explicit OwnedSource(std::string bytes)
      : ByteSource("a.tree", bytes.size()), bytes_(std::move(bytes)) {}

 private:
  void read_in_range(std::uint64_t offset, std::span<std::byte> to) const override {
    if (!to.empty()) std::memcpy(to.data(), bytes_.data() + offset, to.size());
  }
  std::string bytes_;
};

/// The tree with another page, whose checksum is right.
inline std::string with_page(std::string tree, std::uint64_t number,
                             const std::function<void(TreePage&)>& change) {
  const auto header = load_as<TreeHeader>(std::as_bytes(std::span(tree)).data());
  const TreeShape shape(header.gaussians, static_cast<int>(header.sh_degree));
  TreePage page(shape);
  char* at = tree.data() + shape.page_offset(number);
  std::memcpy(page.bytes().data(), at, page.bytes().size());
  change(page);
  page.seal(number);
  std::memcpy(at, page.bytes().data(), page.bytes().size());
  return tree;
}

inline std::unique_ptr<const ByteSource> source_of(std::string bytes) {
  return std::make_unique<OwnedSource>(std::move(bytes));
}

}  // namespace catgs::test
