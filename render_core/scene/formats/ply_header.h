#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "render_core/scene/formats/byte_source.h"
#include "render_core/scene/formats/format_limits.h"
#include "render_core/scene/formats/model_statements.h"

namespace catgs {

enum class PlyEncoding { ascii, binary_little_endian, binary_big_endian };
enum class PlyType { i8, u8, i16, u16, i32, u32, f32, f64 };

std::size_t byte_size(PlyType type);

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::f32;
  std::size_t offset = 0;             // bytes from the start of a row
  bool is_list = false;               // rows of an element with a list have no fixed size
  PlyType length_type = PlyType::u8;  // of a list
};

struct PlyElement {
  std::string name;
  std::uint64_t count = 0;
  std::vector<PlyProperty> properties;
  std::size_t row_bytes = 0;      // binary only
  std::uint64_t data_offset = 0;  // binary only: byte in the file where the rows begin
  bool has_list = false;

  /// By its name, in any case and behind a prefix of CloudCompare's ("scalar_", "scal_").
  [[nodiscard]] const PlyProperty* find(std::string_view property) const;
  /// Harmonics above degree 0, all channels: properties called "f_rest_…".
  [[nodiscard]] std::size_t rest_count() const;
};

struct PlyHeader {
  PlyEncoding encoding = PlyEncoding::binary_little_endian;
  std::vector<PlyElement> elements;
  std::uint64_t bytes = 0;     // the data begins here
  ModelStatements statements;  // of the comments

  [[nodiscard]] const PlyElement* find(std::string_view element) const;
};

/// Parses the header of a PLY file (format 1.0), of at most 1 MiB, and locates the elements. Lines
/// end in LF, CR LF or CR. In binary files, rows of lists before `vertex` are walked.
/// Throws InputError naming the header line.
PlyHeader read_ply_header(const ByteSource& file);

/// Checks that the binary rows of `element` lie inside the file and that they are at most `most`.
/// Throws InputError; call before allocating by count.
void require_rows_in_file(const ByteSource& file, const PlyElement& element,
                          std::uint64_t most = max_gaussians);

}  // namespace catgs
