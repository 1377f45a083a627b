#include "render_core/scene/json_field.h"

#include <cmath>

#include <fmt/format.h>

#include "render_core/camera.h"
#include "render_core/error.h"

namespace catgs {

namespace {

/// Documents are copied and printed by recursion: one of a million brackets would end the stack.
constexpr int max_depth = 256;

void require_shallow(const ByteSource& file, std::string_view text) {
  int depth = 0;
  bool in_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (in_string) {
      if (c == '\\') ++i;
      in_string = c != '"';
    } else if (c == '"') {
      in_string = true;
    } else if (c == '[' || c == '{') {
      if (++depth > max_depth)
        throw InputError(file.name(), fmt::format("byte {}", i),
                         fmt::format("is nested deeper than {}", max_depth));
    } else if (c == ']' || c == '}') {
      --depth;
    }
  }
}

}  // namespace

nlohmann::json read_json(const ByteSource& file, std::uint64_t limit) {
  const std::vector<std::byte> bytes = file.read_all(limit);
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  require_shallow(file, text);
  try {
    return nlohmann::json::parse(text);
  } catch (const nlohmann::json::parse_error& error) {
    throw InputError(file.name(), fmt::format("byte {}", error.byte), "is not valid JSON");
  } catch (const nlohmann::json::out_of_range& error) {
    throw InputError(file.name(), "", fmt::format("holds a number out of range: {}", error.what()));
  }
}

std::string to_utf8(const std::string& bytes) {
  using nlohmann::json;
  return json::parse(json(bytes).dump(-1, ' ', false, json::error_handler_t::replace));
}

void JsonField::fail(std::string_view what, std::string_view remedy) const {
  throw InputError(file_, path_, what, remedy);
}

std::optional<JsonField> JsonField::find(std::string_view key) const {
  if (!value_->is_object()) fail("is not an object");
  const auto found = value_->find(key);
  if (found == value_->end() || found->is_null()) return std::nullopt;
  return JsonField(file_, path_.empty() ? std::string(key) : fmt::format("{}.{}", path_, key),
                   *found);
}

JsonField JsonField::at(std::string_view key) const {
  if (auto member = find(key)) return *std::move(member);
  fail(fmt::format("'{}' is missing", key));
}

std::vector<JsonField> JsonField::elements() const {
  if (!value_->is_array()) fail("is not an array");
  std::vector<JsonField> all;
  for (std::size_t i = 0; i < value_->size(); ++i)
    all.push_back(JsonField(file_, fmt::format("{}[{}]", path_, i), (*value_)[i]));
  return all;
}

float JsonField::number() const {
  if (!value_->is_number()) fail("is not a number");
  const auto number = static_cast<float>(value_->get<double>());
  if (!std::isfinite(number)) fail("is out of range");
  return number;
}

std::uint64_t JsonField::count() const {
  if (!value_->is_number_unsigned()) fail("is not a count");
  return value_->get<std::uint64_t>();
}

std::string JsonField::text() const {
  if (!value_->is_string()) fail("is not a text");
  return value_->get<std::string>();
}

std::vector<float> JsonField::numbers(std::size_t expected_size) const {
  if (!value_->is_array() || value_->size() != expected_size)
    fail(fmt::format("is not an array of {} numbers", expected_size));
  std::vector<float> all;
  for (const JsonField& element : elements()) all.push_back(element.number());
  return all;
}

glm::vec3 JsonField::vec3() const {
  const std::vector<float> v = numbers(3);
  return {v[0], v[1], v[2]};
}

glm::vec3 JsonField::place() const {
  const glm::vec3 at = vec3();
  for (int k = 0; k < 3; ++k)
    if (!(std::abs(at[k]) <= max_coordinate))
      fail(fmt::format("is no place in a scene: beyond {} units", max_coordinate));
  return at;
}

}  // namespace catgs
