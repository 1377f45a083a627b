#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "render_core/scene/tree/tree_shape.h"

namespace catgs {

/// The bytes of a page as the file holds them:
///
///   0   CRC-32 of the page's number (8 bytes) and of everything from byte 4 on
///   4   60 zeros
///   64  NodeFacts of each slot, then the packed block of each slot (scene/packed_gaussian.h)
///
/// All that the tree's shape does not use is zeros: slots without a node, records of a block behind
/// its node's count, and the page's end. Blocks are as the CUDA core reads them.
class TreePage {
 public:
  /// A page of zeros. `shape` must outlive the page.
  explicit TreePage(const TreeShape& shape) : shape_(&shape), bytes_(shape.page_bytes()) {}

  [[nodiscard]] const NodeFacts& facts(std::size_t slot) const {
    return *reinterpret_cast<const NodeFacts*>(bytes_.data() + shape_->facts_offset(slot));
  }
  [[nodiscard]] NodeFacts& facts(std::size_t slot) {
    return *reinterpret_cast<NodeFacts*>(bytes_.data() + shape_->facts_offset(slot));
  }
  [[nodiscard]] std::span<const std::byte> block(std::size_t slot) const {
    return std::span(bytes_).subspan(shape_->block_offset(slot), shape_->block_bytes());
  }
  [[nodiscard]] std::span<std::byte> block(std::size_t slot) {
    return std::span(bytes_).subspan(shape_->block_offset(slot), shape_->block_bytes());
  }
  [[nodiscard]] std::span<std::byte> bytes() { return bytes_; }
  [[nodiscard]] std::span<const std::byte> bytes() const { return bytes_; }

  /// Writes the checksum of page `number`.
  void seal(std::uint64_t number);
  /// Throws InputError that names `file`, the page's offset and what is wrong: the checksum, or a
  /// value that no core may meet. Afterwards the bytes may be uploaded as they are: counts are in
  /// range, errors and bounds are finite and grow towards the root, means lie in their node's
  /// bounds, and unused bytes are zeros. `above`: of the node that the page refines, if it is
  /// known.
  void check(std::uint64_t number, std::string_view file, const NodeFacts* above = nullptr) const;
  /// Turns checked records of version 1 into those of the right one.
  void clear_sh_octaves();

 private:
  /// Names the first unused bytes that are not zeros; empty if there are none. `used`: a bit for
  /// each slot with a node.
  [[nodiscard]] std::string unused_fault(std::uint32_t used) const;
  [[nodiscard]] std::uint32_t checksum(std::uint64_t number) const;

  const TreeShape* shape_;
  std::vector<std::byte> bytes_;
};

}  // namespace catgs
