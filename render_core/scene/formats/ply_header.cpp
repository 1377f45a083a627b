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

constexpr std::size_t max_header_bytes = 64 * 1024;

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

class HeaderParser {
 public:
  HeaderParser(const ByteSource& file, std::string_view text) : file_(file), text_(text) {}

  PlyHeader parse() {
    bool format_known = false;
    for (;;) {
      const auto words = split(next_line());
      if (line_number_ == 1) {
        if (words.size() != 1 || words[0] != "ply") fail("a PLY file begins with the line 'ply'");
      } else if (words.empty() || words[0] == "comment" || words[0] == "obj_info") {
        read_comment(words);
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

  std::string_view next_line() {
    ++line_number_;
    const std::size_t end = text_.find('\n', at_);
    if (end == std::string_view::npos)
      fail(text_.size() < max_header_bytes ? "the file ends inside the header"
                                           : "no 'end_header' within the first 64 KiB");
    const auto line = text_.substr(at_, end - at_);
    at_ = end + 1;
    return line;
  }

  /// Comments of other programs and unknown values say nothing.
  void read_comment(const std::vector<std::string_view>& words) {
    if (words.size() != 3) return;
    if (words[1] == "SplatRenderMode:") {
      if (const auto model = splat_model_named(words[2])) header_.model = model;
    } else if (words[1] == "antialiased" && (words[2] == "0" || words[2] == "1")) {
      header_.model = words[2] == "1" ? SplatModel::antialiased : SplatModel::standard;
    }
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
      type_of(words[2]);
      property.is_list = element.has_list = true;
    } else if (words.size() != 3) {
      fail("expected 'property <type> <name>'");
    }
    property.type = type_of(words[words.size() - 2]);
    property.name = words.back();
    property.offset = element.row_bytes;
    if (element.find(property.name)) fail(fmt::format("second property '{}'", property.name));
    element.row_bytes += byte_size(property.type);
    element.properties.push_back(std::move(property));
  }

  /// Elements behind one with a list cannot be located; none of the formats has any.
  void locate_elements() {
    std::uint64_t offset = header_.bytes;
    for (PlyElement& element : header_.elements) {
      element.data_offset = offset;
      if (header_.encoding == PlyEncoding::ascii || element.has_list) return;
      if (element.row_bytes > 0 && element.count > (file_.size() - offset) / element.row_bytes)
        return;  // cut off here: the reader of this element or a later one reports it
      offset += element.count * element.row_bytes;
    }
  }

  const ByteSource& file_;
  std::string_view text_;
  std::size_t at_ = 0;
  int line_number_ = 0;
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
  const auto found = std::find_if(properties.begin(), properties.end(),
                                  [&](const PlyProperty& p) { return p.name == property; });
  return found == properties.end() ? nullptr : &*found;
}

std::size_t PlyElement::rest_count() const {
  const auto is_rest = [](const PlyProperty& p) { return p.name.starts_with("f_rest_"); };
  return static_cast<std::size_t>(std::count_if(properties.begin(), properties.end(), is_rest));
}

const PlyElement* PlyHeader::find(std::string_view element) const {
  const auto found = std::find_if(elements.begin(), elements.end(),
                                  [&](const PlyElement& e) { return e.name == element; });
  return found == elements.end() ? nullptr : &*found;
}

PlyHeader read_ply_header(const ByteSource& file) {
  std::string text(std::min<std::uint64_t>(file.size(), max_header_bytes), '\0');
  file.read(0, std::as_writable_bytes(std::span(text)));
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
