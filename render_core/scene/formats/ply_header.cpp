#include "render_core/scene/formats/ply_header.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>

#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/scene/formats/format_limits.h"

namespace catgs {

namespace {

constexpr std::size_t max_header_bytes = std::size_t{1} << 20;

struct TypeName {
  std::string_view name;
  PlyType type;
};
constexpr std::array type_names = {
    TypeName{"char", PlyType::i8},    TypeName{"int8", PlyType::i8},
    TypeName{"uchar", PlyType::u8},   TypeName{"uint8", PlyType::u8},
    TypeName{"short", PlyType::i16},  TypeName{"int16", PlyType::i16},
    TypeName{"ushort", PlyType::u16}, TypeName{"uint16", PlyType::u16},
    TypeName{"int", PlyType::i32},    TypeName{"int32", PlyType::i32},
    TypeName{"uint", PlyType::u32},   TypeName{"uint32", PlyType::u32},
    TypeName{"float", PlyType::f32},  TypeName{"float32", PlyType::f32},
    TypeName{"double", PlyType::f64}, TypeName{"float64", PlyType::f64},
};

std::vector<std::string_view> split(std::string_view line) {
  std::vector<std::string_view> words;
  for (std::size_t at = 0; (at = line.find_first_not_of(" \t\r", at)) != std::string_view::npos;) {
    const std::size_t end = std::min(line.find_first_of(" \t\r", at), line.size());
    words.push_back(line.substr(at, end - at));
    at = end;
  }
  return words;
}

/// Finds the end of rows that have lists, through a window of the file.
class ListWalk {
 public:
  ListWalk(const ByteSource& file, std::uint64_t begin, bool big_endian)
      : file_(file), at_(begin), big_endian_(big_endian) {}

  std::uint64_t end_of_rows(const PlyElement& element) {
    for (std::uint64_t row = 0; row < element.count; ++row)
      for (const PlyProperty& property : element.properties)
        if (property.is_list)
          skip(element, length_of_list(element, property.length_type), byte_size(property.type));
        else
          skip(element, 1, byte_size(property.type));
    return at_;
  }

 private:
  [[noreturn]] void fail(const PlyElement& element, std::string_view what) const {
    throw InputError(file_.name(), fmt::format("byte {}", at_),
                     fmt::format("element {}: {}", element.name, what),
                     "the file is cut off or its header is wrong");
  }

  void skip(const PlyElement& element, std::uint64_t count, std::size_t bytes) {
    if (count > (file_.size() - at_) / bytes) fail(element, "the file ends inside its rows");
    at_ += count * bytes;
  }

  std::uint64_t length_of_list(const PlyElement& element, PlyType type) {
    const std::size_t bytes = byte_size(type);
    if (at_ < window_begin_ || at_ + bytes > window_begin_ + window_.size()) {
      window_begin_ = at_;
      window_.resize(std::min<std::uint64_t>(file_.size() - at_, 64 * 1024));
      file_.read(at_, window_);
    }
    const std::uint64_t begin = at_ - window_begin_;
    skip(element, 1, bytes);
    std::uint64_t length = 0;
    for (std::size_t i = 0; i < bytes; ++i)
      length = length << 8 |
               std::to_integer<std::uint64_t>(window_[begin + (big_endian_ ? i : bytes - 1 - i)]);
    const bool is_signed = type == PlyType::i8 || type == PlyType::i16 || type == PlyType::i32;
    if (is_signed && length >> (8 * bytes - 1) != 0) fail(element, "a list has a negative length");
    return length;
  }

  const ByteSource& file_;
  std::uint64_t at_, window_begin_ = 0;
  std::vector<std::byte> window_;
  const bool big_endian_;
};

/// The name that a property had before CloudCompare wrote it. It reads what it does not know as
/// scalar fields, and saves those behind a prefix; earlier versions had another one on reading.
std::string_view without_prefix(std::string_view name) {
  for (const std::string_view prefix : {"scalar_", "scal_"})
    if (std::ranges::equal(name.substr(0, prefix.size()), prefix, {}, to_lower))
      name.remove_prefix(prefix.size());
  return name;
}

class HeaderParser {
 public:
  HeaderParser(const ByteSource& file, std::string_view text) : file_(file), text_(text) {}

  PlyHeader parse() {
    bool format_known = false;
    for (;;) {
      const std::string_view line = next_line();
      const auto words = split(line);
      if (line_number_ == 1) {
        if (words.size() != 1 || words[0] != "ply") fail("a PLY file begins with the line 'ply'");
      } else if (words.empty()) {
        continue;
      } else if (words[0] == "comment" || words[0] == "obj_info") {
        header_.statements.read(line.substr(line.find(words[0]) + words[0].size()));
      } else if (words[0] == "format") {
        parse_format(words);
        format_known = true;
      } else if (words[0] == "element") {
        parse_element(words);
      } else if (words[0] == "property") {
        parse_property(words);
      } else if (words[0] == "end_header") {
        if (!format_known) fail("the header ends without a 'format' line");
        break;
      } else {
        fail(fmt::format("unknown keyword '{}'", words[0]));
      }
    }
    header_.bytes = at_;
    locate_elements();
    return std::move(header_);
  }

 private:
  [[noreturn]] void fail(std::string_view what) const {
    throw InputError(file_.name(), fmt::format("header line {}", line_number_), what);
  }

  /// The first line tells whether the lines end in CR alone.
  std::string_view next_line() {
    if (++line_number_ == 1) {
      const std::size_t end = text_.find_first_of("\r\n");
      if (end != std::string_view::npos && text_[end] == '\r' && text_.substr(end, 2) != "\r\n")
        line_end_ = '\r';
    }
    const std::size_t end = text_.find(line_end_, at_);
    if (end == std::string_view::npos)
      fail(text_.size() < max_header_bytes ? "the file ends inside the header"
                                           : "no 'end_header' within the first MiB");
    const auto line = text_.substr(at_, end - at_);
    at_ = end + 1;
    return line;
  }

  void parse_format(const std::vector<std::string_view>& words) {
    if (words.size() != 3 || words[2] != "1.0") fail("expected 'format <encoding> 1.0'");
    if (words[1] == "ascii")
      header_.encoding = PlyEncoding::ascii;
    else if (words[1] == "binary_little_endian")
      header_.encoding = PlyEncoding::binary_little_endian;
    else if (words[1] == "binary_big_endian")
      header_.encoding = PlyEncoding::binary_big_endian;
    else
      fail(fmt::format("unknown encoding '{}'", words[1]));
  }

  void parse_element(const std::vector<std::string_view>& words) {
    if (words.size() != 3) fail("expected 'element <name> <count>'");
    PlyElement element;
    element.name = words[1];
    const auto [end, error] =
        std::from_chars(words[2].data(), words[2].data() + words[2].size(), element.count);
    if (error != std::errc{} || end != words[2].data() + words[2].size())
      fail(fmt::format("'{}' is not a count", words[2]));
    if (header_.find(element.name)) fail(fmt::format("second element '{}'", element.name));
    header_.elements.push_back(std::move(element));
  }

  PlyType type_of(std::string_view name) const {
    const auto* found = std::find_if(type_names.begin(), type_names.end(),
                                     [&](const TypeName& t) { return t.name == name; });
    if (found == type_names.end()) fail(fmt::format("unknown type '{}'", name));
    return found->type;
  }

  void parse_property(const std::vector<std::string_view>& words) {
    if (header_.elements.empty()) fail("property before the first element");
    PlyElement& element = header_.elements.back();
    PlyProperty property;
    if (words.size() == 5 && words[1] == "list") {
      property.length_type = type_of(words[2]);
      if (property.length_type >= PlyType::f32) fail("the length of a list is no whole number");
      property.is_list = element.has_list = true;
    } else if (words.size() != 3) {
      fail("expected 'property <type> <name>'");
    }
    property.type = type_of(words[words.size() - 2]);
    property.name = words.back();
    property.offset = element.row_bytes;
    if (std::ranges::find(element.properties, property.name, &PlyProperty::name) !=
        element.properties.end())
      fail(fmt::format("second property '{}'", property.name));
    element.row_bytes += byte_size(property.type);
    element.properties.push_back(std::move(property));
  }

  /// Rows of lists behind `vertex` are not walked: scenes have nothing there.
  void locate_elements() {
    if (header_.encoding == PlyEncoding::ascii) return;
    const bool big_endian = header_.encoding == PlyEncoding::binary_big_endian;
    std::uint64_t offset = header_.bytes;
    bool vertex_located = false;
    for (PlyElement& element : header_.elements) {
      element.data_offset = offset;
      vertex_located |= element.name == "vertex";
      if (element.has_list) {
        if (vertex_located || !header_.find("vertex")) return;
        offset = ListWalk(file_, offset, big_endian).end_of_rows(element);
        continue;
      }
      if (element.row_bytes > 0 && element.count > (file_.size() - offset) / element.row_bytes)
        return;  // cut off here: the reader of this element or a later one reports it
      offset += element.count * element.row_bytes;
    }
  }

  const ByteSource& file_;
  std::string_view text_;
  std::size_t at_ = 0;
  int line_number_ = 0;
  char line_end_ = '\n';
  PlyHeader header_;
};

}  // namespace

std::size_t byte_size(PlyType type) {
  switch (type) {
    case PlyType::i8:
    case PlyType::u8:
      return 1;
    case PlyType::i16:
    case PlyType::u16:
      return 2;
    case PlyType::i32:
    case PlyType::u32:
    case PlyType::f32:
      return 4;
    case PlyType::f64:
      return 8;
  }
  return 0;
}

const PlyProperty* PlyElement::find(std::string_view property) const {
  auto found = std::ranges::find(properties, property, &PlyProperty::name);
  if (found == properties.end())
    found = std::ranges::find_if(properties, [&](const PlyProperty& p) {
      return std::ranges::equal(without_prefix(p.name), property, {}, to_lower, to_lower);
    });
  return found == properties.end() ? nullptr : &*found;
}

std::size_t PlyElement::rest_count() const {
  constexpr std::string_view prefix = "f_rest_";
  const auto is_rest = [&](const PlyProperty& p) {
    return std::ranges::equal(without_prefix(p.name).substr(0, prefix.size()), prefix, {},
                              to_lower);
  };
  return static_cast<std::size_t>(std::ranges::count_if(properties, is_rest));
}

const PlyElement* PlyHeader::find(std::string_view element) const {
  const auto found = std::find_if(elements.begin(), elements.end(),
                                  [&](const PlyElement& e) { return e.name == element; });
  return found == elements.end() ? nullptr : &*found;
}

PlyHeader read_ply_header(const ByteSource& file) {
  std::string text;
  for (std::size_t most : {max_header_bytes / 16, max_header_bytes}) {  // few need the whole
    text.resize(std::min<std::uint64_t>(file.size(), most));
    file.read(0, std::as_writable_bytes(std::span(text)));
    const std::size_t end = std::min(text.find("\nend_header"), text.find("\rend_header"));
    constexpr std::size_t last_line = 64;  // with spaces behind
    if (end < text.size() && text.size() - end >= last_line) break;
  }
  return HeaderParser(file, text).parse();
}

void require_rows_in_file(const ByteSource& file, const PlyElement& element, std::uint64_t most) {
  const std::string where = fmt::format("element {}", element.name);
  if (element.data_offset == 0)
    throw InputError(file.name(), where,
                     "cannot be located: an element before it has a list "
                     "property or is cut off");
  if (element.has_list)
    throw InputError(file.name(), where, "has a list property, so its rows have no fixed size");
  require_count(file, where, element.count, most);
  if (element.row_bytes > 0 &&
      element.count > (file.size() - element.data_offset) / element.row_bytes)
    throw InputError(
        file.name(), fmt::format("byte {}", file.size()),
        fmt::format("the file ends here, but its header announces {} rows of {} bytes "
                    "for element {} from byte {} on",
                    element.count, element.row_bytes, element.name, element.data_offset),
        "the file is cut off or its header is wrong");
}

}  // namespace catgs
