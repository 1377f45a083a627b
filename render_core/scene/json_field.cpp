#include "render_core/scene/json_field.h"

#include <cmath>

#include <fmt/format.h>

#include "render_core/error.h"

namespace catgs {

nlohmann::json read_json(const ByteSource& file, std::uint64_t limit) {
  const std::vector<std::byte> bytes = file.read_all(limit);
  const auto* first = reinterpret_cast<const char*>(bytes.data());
  try {
    return nlohmann::json::parse(first, first + bytes.size());
  } catch (const nlohmann::json::parse_error& error) {
    throw InputError(file.name(), fmt::format("byte {}", error.byte), "is not valid JSON");
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

}  // namespace catgs
