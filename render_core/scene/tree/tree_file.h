#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <unordered_set>

#include "render_core/scene/formats/byte_source.h"
#include "render_core/scene/scene.h"
#include "render_core/scene/tree/tree_page.h"

namespace catgs {

/// Sizes and errors of one level of a tree.
struct TreeLevel {
  std::uint64_t gaussians = 0;
  float mean_error = 0.0f, max_error = 0.0f;  // of its nodes, world units

  bool operator==(const TreeLevel&) const = default;
};

/// The first bytes of a .tree file, little-endian; pages follow at byte 4096 (TreeShape).
struct TreeHeader {
  static constexpr std::array<char, 8> right_magic = {'c', 'a', 't', 'g', 's', 't', 'r', 'e'};
  // Records of version 1 have no octaves for their harmonics: see clear_sh_octaves().
  static constexpr std::uint32_t first_version = 1, right_version = 2;
  static constexpr std::size_t most_levels = 27;

  std::array<char, 8> magic = right_magic;
  std::uint32_t version = right_version;
  std::uint16_t sh_degree = 0;
  SplatModel model = SplatModel::standard;
  std::uint8_t reserved = 0;
  std::uint64_t gaussians = 0;                  // of the leaves
  glm::vec3 low{0.0f}, high{0.0f};              // ends of the box of their means
  std::uint64_t read = 0, dropped = 0;          // SanitizeReport of the scene it was made from
  std::array<char, 64> source{};                // format of that scene, UTF-8, ends with a zero
  std::array<TreeLevel, most_levels> levels{};  // leaves first
  std::uint64_t checksum = 0;                   // CRC-32 of the bytes before it
  // Zeros in older files, which are about 0.
  glm::dvec3 origin{0.0};
  std::uint64_t origin_checksum = 0;  // CRC-32 of the origin, unless that is 0

  [[nodiscard]] std::uint32_t right_checksum() const;
  [[nodiscard]] std::uint32_t right_origin_checksum() const;
};
static_assert(offsetof(TreeHeader, origin) == 568 && sizeof(TreeHeader) == 600 &&
              sizeof(TreeHeader) <= TreeShape::header_bytes);

/// Whether a file begins like a tree.
bool is_tree(const ByteSource& file);

/// Reads the header. Throws InputError naming the field that is wrong. Pages may be missing.
TreeHeader read_tree_header(const ByteSource& file);

/// The pages of a tree, read when they are asked for, and checked as they are read. Thread-safe.
/// Pages are read, not mapped, for the reasons that ByteSource gives. None is kept here, because
/// the system's cache holds what was read lately.
class TreeFile {
 public:
  /// Throws InputError as read_tree_header() does.
  explicit TreeFile(std::unique_ptr<const ByteSource> file);

  [[nodiscard]] const std::string& name() const { return file_->name(); }
  [[nodiscard]] const TreeHeader& header() const { return header_; }
  [[nodiscard]] const TreeShape& shape() const { return shape_; }
  /// The header's model, or the one given to set_model().
  [[nodiscard]] SplatModel model() const { return header_.model; }
  /// Call before others use the tree.
  void set_model(SplatModel model) { header_.model = model; }
  /// Less than shape().pages() where the file is cut off.
  [[nodiscard]] std::uint64_t pages_in_file() const;

  /// A page of [0, shape().pages()). `above`: of the node that the page refines, whose error and
  /// bounds the page must not exceed. Records are of the right version, whatever the file has.
  /// Throws InputError if it is damaged or missing.
  [[nodiscard]] std::unique_ptr<const TreePage> read(std::uint64_t number,
                                                     const NodeFacts* above = nullptr) const;
  /// The same, but null if it is damaged or missing. damage() counts it.
  std::unique_ptr<const TreePage> page(std::uint64_t number, const NodeFacts* above = nullptr);

  struct Damage {
    std::uint64_t pages = 0;  // that were asked for and could not be used
    std::string first;        // what was wrong with the first of them
  };
  [[nodiscard]] Damage damage() const;

 private:
  std::unique_ptr<const ByteSource> file_;
  TreeHeader header_;
  TreeShape shape_;
  mutable std::mutex mutex_;  // guards the rest
  std::unordered_set<std::uint64_t> damaged_;
  std::string first_damage_;
};

}  // namespace catgs
