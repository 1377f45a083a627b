#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "render_core/scene/formats/byte_source.h"
#include "render_core/scene/formats/file_set.h"
#include "render_core/scene/formats/json_field.h"

namespace catgs {

/// The component types of vertex attributes, by their glTF numbers.
enum class GltfComponent {
  byte = 5120,
  unsigned_byte = 5121,
  short_int = 5122,
  unsigned_short = 5123,
  float32 = 5126,
};

struct GltfSparseRows;

/// A table of numbers in a buffer, checked to lie inside it.
struct GltfAccessor {
  const ByteSource* buffer = nullptr;  // null: the numbers are 0
  std::uint64_t offset = 0;            // of the first row, in `buffer`
  std::size_t stride = 0;              // bytes from a row to the next
  std::uint64_t count = 0;             // rows
  std::size_t columns = 0;
  GltfComponent component = GltfComponent::float32;
  bool normalized = false;  // integers stand for 0…1 or -1…1
  std::shared_ptr<const GltfSparseRows> sparse{};

  /// Rows [begin, end), row by row, as the numbers that they stand for. Throws InputError when the
  /// buffer's file became shorter.
  [[nodiscard]] std::vector<float> read(std::size_t begin, std::size_t end) const;
};

/// Rows of an accessor that have other values than its buffer.
struct GltfSparseRows {
  std::vector<std::uint32_t> rows;  // ascending
  GltfAccessor values;              // one for each
};

/// Some bytes of a buffer, checked to lie inside it.
struct GltfBytes {
  const ByteSource* file = nullptr;
  std::uint64_t offset = 0, size = 0;
};

/// The name of a file that a URI names, without the URI's escapes ("%20").
std::string unescaped(std::string_view uri);

/// Whether the file begins as a .glb does.
bool is_glb(const ByteSource& file);

/// A glTF 2.0 file, text or binary (.glb): its JSON, and tables of numbers in its buffers. A buffer
/// is the chunk of a .glb, a data: URI, or a file beside the glTF file.
class GltfDocument {
 public:
  /// Reads the JSON. `file` and `beside` must outlive the document. Throws InputError.
  GltfDocument(const ByteSource& file, const FileSet& beside);

  [[nodiscard]] JsonField root() const { return {name_, json_}; }
  /// The entry of a list at the root that `index` names: at("accessors", index).
  [[nodiscard]] JsonField at(std::string_view list, const JsonField& index) const;
  /// The accessor that `index` names. Opens its buffer. Throws InputError naming the field.
  [[nodiscard]] GltfAccessor accessor(const JsonField& index);
  /// The bytes of the buffer view that `index` names. Opens its buffer. Throws InputError.
  [[nodiscard]] GltfBytes view(const JsonField& index);
  /// The files that hold buffers, opened or not.
  [[nodiscard]] std::vector<std::string> buffer_files() const;
  /// Bytes of the .glb's chunk and of the buffers that were opened.
  [[nodiscard]] std::uint64_t bytes() const;

 private:
  [[nodiscard]] nlohmann::json read_glb(const ByteSource& file);
  [[nodiscard]] GltfBytes buffer(const JsonField& index);
  /// Finds the rows in the buffer view that `field` names.
  void locate(const JsonField& field, GltfAccessor& accessor);
  [[nodiscard]] GltfSparseRows sparse_rows(const JsonField& field, const GltfAccessor& accessor);
  [[nodiscard]] const ByteSource& open(const JsonField& uri);

  std::string name_;
  const FileSet& beside_;
  GltfBytes chunk_;  // of a .glb
  nlohmann::json json_;
  std::map<std::string, std::unique_ptr<ByteSource>> files_;  // by URI, or by name
  std::map<std::uint64_t, GltfBytes> buffers_;                // that are open, by index
  std::vector<std::vector<std::byte>> data_;                  // of data: URIs
};

}  // namespace catgs
