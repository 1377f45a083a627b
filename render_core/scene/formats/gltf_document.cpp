#include "render_core/scene/formats/gltf_document.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstring>
#include <limits>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/scene/formats/format_limits.h"

namespace catgs {

namespace {

constexpr std::uint64_t max_json_bytes = 16 << 20;
constexpr std::size_t max_buffers = 256;   // a file of each stays open
constexpr std::uint64_t max_stride = 252;  // by the specification
constexpr std::uint32_t json_chunk = 0x4e4f534a, binary_chunk = 0x004e4942;
constexpr std::size_t glb_header_bytes = 12, chunk_header_bytes = 8;

struct ChunkHeader {
  std::uint32_t size, kind;
};

ChunkHeader read_chunk_header(const ByteSource& file, std::uint64_t at) {
  std::array<std::uint32_t, 2> words;
  file.read(at, std::as_writable_bytes(std::span(words)));
  if (words[0] > file.size() - at - chunk_header_bytes)
    throw InputError(file.name(), fmt::format("byte {}", at),
                     fmt::format("a chunk of {} bytes is cut off", words[0]));
  return {words[0], words[1]};
}

/// Calls body(T{}) with the type of the component.
template <class Body>
auto with_type(GltfComponent component, const Body& body) {
  switch (component) {
    case GltfComponent::byte:
      return body(std::int8_t{});
    case GltfComponent::unsigned_byte:
      return body(std::uint8_t{});
    case GltfComponent::short_int:
      return body(std::int16_t{});
    case GltfComponent::unsigned_short:
      return body(std::uint16_t{});
    case GltfComponent::float32:
      break;
  }
  return body(0.0f);
}

std::size_t component_bytes(GltfComponent component) {
  return with_type(component, [](auto number) { return sizeof number; });
}

GltfComponent component_of(const JsonField& field) {
  for (const GltfComponent known :
       {GltfComponent::byte, GltfComponent::unsigned_byte, GltfComponent::short_int,
        GltfComponent::unsigned_short, GltfComponent::float32})
    if (field.count() == static_cast<std::uint64_t>(known)) return known;
  field.fail("is not a component type of an attribute");
}

std::size_t bytes_of_index(const JsonField& component_type) {
  constexpr std::array<std::uint64_t, 3> types = {5121, 5123, 5125};  // unsigned
  const auto found = std::ranges::find(types, component_type.count());
  if (found == types.end()) component_type.fail("is not a component type of an index");
  return std::size_t{1} << (found - types.begin());
}

std::size_t columns_of(const JsonField& field) {
  constexpr std::array<std::string_view, 4> names = {"SCALAR", "VEC2", "VEC3", "VEC4"};
  const auto found = std::find(names.begin(), names.end(), field.text());
  if (found == names.end()) field.fail("is no SCALAR, VEC2, VEC3 or VEC4");
  return static_cast<std::size_t>(found - names.begin()) + 1;
}

std::uint64_t count_or(const JsonField& object, std::string_view key, std::uint64_t otherwise) {
  const auto field = object.find(key);
  return field ? field->count() : otherwise;
}

/// Throws unless bytes [offset, offset + size) are among `held`.
void require_inside(const JsonField& field, std::uint64_t offset, std::uint64_t size,
                    std::uint64_t held) {
  if (offset > held || size > held - offset)
    field.fail(fmt::format("takes {} bytes from byte {} on, of {}", size, offset, held),
               "the file is cut off or its JSON is wrong");
}

/// The number for each character of RFC 4648's alphabet; 64 for others.
constexpr std::array<std::uint8_t, 256> base64_values() {
  constexpr std::string_view alphabet =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::array<std::uint8_t, 256> values{};
  values.fill(64);
  for (std::size_t i = 0; i < alphabet.size(); ++i)
    values[static_cast<unsigned char>(alphabet[i])] = static_cast<std::uint8_t>(i);
  return values;
}

std::vector<std::byte> decode_base64(const JsonField& uri, std::string_view text) {
  static constexpr auto values = base64_values();
  while (text.ends_with('=')) text.remove_suffix(1);
  std::vector<std::byte> bytes;
  bytes.reserve(text.size() / 4 * 3 + 3);
  std::uint32_t bits = 0;
  int held = 0;
  for (const char c : text) {
    const std::uint32_t value = values[static_cast<unsigned char>(c)];
    if (value == 64) uri.fail("is not base64 data");
    bits = bits << 6 | value;
    held += 6;
    if (held < 8) continue;
    held -= 8;
    bytes.push_back(static_cast<std::byte>(bits >> held));
  }
  return bytes;
}

template <class T>
void convert(const std::byte* from, const GltfAccessor& rows, std::vector<float>& to) {
  float largest = 1.0f;
  if constexpr (std::is_integral_v<T>)
    if (rows.normalized) largest = static_cast<float>(std::numeric_limits<T>::max());
  for (std::size_t i = 0; i < to.size(); from += rows.stride)
    for (std::size_t c = 0; c < rows.columns; ++c, ++i) {
      to[i] = static_cast<float>(load_as<T>(from + c * sizeof(T))) / largest;
      if (largest > 1.0f) to[i] = std::max(to[i], -1.0f);  // -128 stands for -1, as -127 does
    }
}

}  // namespace

std::vector<float> GltfAccessor::read(std::size_t begin, std::size_t end) const {
  std::vector<float> numbers((end - begin) * columns);
  if (numbers.empty()) return numbers;
  if (buffer) {
    std::vector<std::byte> bytes((end - begin - 1) * stride + columns * component_bytes(component));
    buffer->read(offset + begin * stride, bytes);
    with_type(component, [&]<class T>(T) { convert<T>(bytes.data(), *this, numbers); });
  }
  if (!sparse) return numbers;
  const auto& rows = sparse->rows;
  const auto first = std::ranges::lower_bound(rows, begin),
             last = std::ranges::lower_bound(rows, end);
  const auto position = static_cast<std::size_t>(first - rows.begin());
  const std::vector<float> values =
      sparse->values.read(position, static_cast<std::size_t>(last - rows.begin()));
  for (std::size_t i = 0; i * columns < values.size(); ++i)
    std::copy_n(
        values.begin() + static_cast<std::ptrdiff_t>(i * columns), columns,
        numbers.begin() + static_cast<std::ptrdiff_t>((rows[position + i] - begin) * columns));
  return numbers;
}

std::string unescaped(std::string_view uri) {
  std::string name;
  for (std::size_t i = 0; i < uri.size(); ++i) {
    unsigned char value = 0;
    const char* digits = uri.data() + i + 1;
    if (uri[i] == '%' && i + 2 < uri.size() &&
        std::from_chars(digits, digits + 2, value, 16).ptr == digits + 2) {
      name.push_back(static_cast<char>(value));
      i += 2;
    } else {
      name.push_back(uri[i]);
    }
  }
  return name;
}

namespace {

bool is_data(std::string_view uri) { return uri.starts_with("data:"); }

/// A file has one name, whatever it is called.
std::string file_named_by(std::string_view uri) {
  return std::filesystem::path(unescaped(uri)).lexically_normal().string();
}

}  // namespace

bool is_glb(const ByteSource& file) { return begins_with(file, "glTF"); }

GltfDocument::GltfDocument(const ByteSource& file, const FileSet& beside)
    : name_(file.name()), beside_(beside) {
  json_ = is_glb(file) ? read_glb(file) : read_json(file, max_json_bytes);
  const JsonField version = root().at("asset").at("version");
  if (!version.text().starts_with("2.")) version.fail("is not supported", "glTF 2.0 is");
}

nlohmann::json GltfDocument::read_glb(const ByteSource& file) {
  std::array<std::uint32_t, 3> header;  // magic, version, size
  file.read(0, std::as_writable_bytes(std::span(header)));
  if (header[1] != 2)
    throw InputError(file.name(), "byte 4", fmt::format("version {} of .glb", header[1]),
                     "version 2 is supported");
  const ChunkHeader first = read_chunk_header(file, glb_header_bytes);
  if (first.kind != json_chunk)
    throw InputError(file.name(), fmt::format("byte {}", glb_header_bytes),
                     "the first chunk of a .glb holds its JSON");
  if (first.size > max_json_bytes)
    throw InputError(file.name(), "JSON",
                     fmt::format("{} bytes, at most {} are supported", first.size, max_json_bytes));
  std::vector<std::byte> text(first.size);
  file.read(glb_header_bytes + chunk_header_bytes, text);
  const std::uint64_t next = glb_header_bytes + chunk_header_bytes + first.size;
  if (next + chunk_header_bytes <= file.size()) {
    const ChunkHeader second = read_chunk_header(file, next);
    if (second.kind == binary_chunk) chunk_ = {&file, next + chunk_header_bytes, second.size};
  }
  return read_json(MemorySource(file.name(), text), max_json_bytes);
}

JsonField GltfDocument::at(std::string_view list, const JsonField& index) const {
  const JsonField entries = root().at(list);
  if (index.count() >= entries.size())
    index.fail(fmt::format("is {}, and there are {} {}", index.count(), entries.size(), list));
  return entries[index.count()];
}

std::vector<std::string> GltfDocument::buffer_files() const {
  std::vector<std::string> names;
  if (const auto buffers = root().find("buffers"))
    for (std::size_t i = 0; i < buffers->size() && i < max_buffers; ++i)
      if (const auto uri = (*buffers)[i].find("uri"); uri && !is_data(uri->text()))
        names.push_back(file_named_by(uri->text()));
  return names;
}

const ByteSource& GltfDocument::open(const JsonField& uri) {
  const std::string text = uri.text();
  const std::string name = is_data(text) ? text : file_named_by(text);
  if (const auto known = files_.find(name); known != files_.end()) return *known->second;
  if (files_.size() >= max_buffers)
    uri.fail(fmt::format("is of more than {} buffers", max_buffers));
  if (!is_data(text)) return *(files_[name] = beside_.open(name));
  constexpr std::string_view marker = ";base64,";
  const std::size_t found = text.find(marker);
  if (found == std::string::npos) uri.fail("is a data: URI without base64");
  data_.push_back(decode_base64(uri, std::string_view(text).substr(found + marker.size())));
  return *(files_[name] = std::make_unique<MemorySource>(name_ + ": data", data_.back()));
}

GltfBytes GltfDocument::buffer(const JsonField& index) {
  const auto known = buffers_.find(index.count());
  if (known != buffers_.end()) return known->second;
  const JsonField field = at("buffers", index);
  if (const auto uri = field.find("uri")) {
    const ByteSource& file = open(*uri);
    return buffers_[index.count()] = {&file, 0, file.size()};
  }
  if (!chunk_.file || index.count() != 0)
    field.fail("has no uri", "only the first buffer of a .glb lies in its own file");
  return chunk_;
}

GltfBytes GltfDocument::view(const JsonField& index) {
  const JsonField view = at("bufferViews", index);
  const GltfBytes whole = buffer(view.at("buffer"));
  const std::uint64_t begin = count_or(view, "byteOffset", 0), size = view.at("byteLength").count();
  require_inside(view, begin, size, whole.size);
  return {whole.file, whole.offset + begin, size};
}

GltfAccessor GltfDocument::accessor(const JsonField& index) {
  const JsonField field = at("accessors", index);
  GltfAccessor accessor;
  accessor.count = field.at("count").count();
  accessor.columns = columns_of(field.at("type"));
  accessor.component = component_of(field.at("componentType"));
  if (const auto flag = field.find("normalized")) {
    if (!flag->value().is_boolean()) flag->fail("is neither true nor false");
    accessor.normalized = flag->value().get<bool>();
  }
  if (accessor.count == 0 || accessor.count > max_gaussians)
    field.at("count").fail(fmt::format("is not in 1…{}", max_gaussians));

  if (field.find("bufferView")) locate(field, accessor);
  if (const auto sparse = field.find("sparse"))
    accessor.sparse = std::make_shared<const GltfSparseRows>(sparse_rows(*sparse, accessor));
  return accessor;
}

void GltfDocument::locate(const JsonField& field, GltfAccessor& accessor) {
  const GltfBytes bytes = view(field.at("bufferView"));
  const JsonField layout = at("bufferViews", field.at("bufferView"));
  const std::uint64_t row_bytes = accessor.columns * component_bytes(accessor.component);
  const std::uint64_t stride = count_or(layout, "byteStride", row_bytes);
  if (stride < row_bytes || stride > max_stride)
    layout.at("byteStride").fail(fmt::format("is not in {}…{}", row_bytes, max_stride));
  const std::uint64_t first = count_or(field, "byteOffset", 0);
  require_inside(field, first, (accessor.count - 1) * stride + row_bytes, bytes.size);
  accessor.buffer = bytes.file;
  accessor.offset = bytes.offset + first;
  accessor.stride = stride;
}

GltfSparseRows GltfDocument::sparse_rows(const JsonField& field, const GltfAccessor& accessor) {
  const std::uint64_t count = field.at("count").count();
  if (count == 0 || count > accessor.count)
    field.at("count").fail(fmt::format("is not in 1…{}", accessor.count));
  const JsonField indices = field.at("indices"), kind = indices.at("componentType");
  const std::size_t bytes_each = bytes_of_index(kind);
  const GltfBytes held = view(indices.at("bufferView"));
  const std::uint64_t first = count_or(indices, "byteOffset", 0);
  require_inside(indices, first, count * bytes_each, held.size);
  std::vector<std::byte> bytes(count * bytes_each);
  held.file->read(held.offset + first, bytes);
  GltfSparseRows sparse{std::vector<std::uint32_t>(count), accessor};
  for (std::size_t i = 0; i < count; ++i) {
    std::memcpy(&sparse.rows[i], &bytes[i * bytes_each], bytes_each);
    if (sparse.rows[i] >= accessor.count || (i > 0 && sparse.rows[i] <= sparse.rows[i - 1]))
      indices.fail("do not ascend, or name a row that is not there");
  }
  sparse.values.count = count;
  locate(field.at("values"), sparse.values);
  return sparse;
}

std::uint64_t GltfDocument::bytes() const {
  std::uint64_t sum = chunk_.size;
  for (const auto& [uri, file] : files_) sum += file->size();
  return sum;
}

}  // namespace catgs
