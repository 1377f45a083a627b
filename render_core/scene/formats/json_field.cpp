#include "render_core/scene/formats/json_field.h"

#include <cassert>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "render_core/base/error.h"
#include "render_core/math/camera.h"

namespace catgs {

namespace {

/// Documents are copied and printed recursively: a million brackets would overflow the stack.
constexpr int max_depth = 256;
/// A number takes sixteen bytes in memory. An empty array or object takes a hundred and counts
/// twice.
constexpr std::size_t max_values = std::size_t{1} << 20;

/// Walks through a document before anything is made of it. The library's own callback would do both
/// at once, but looks at all entries of a list whenever one of them ends.
class LimitCheck final : public nlohmann::json_sax<nlohmann::json> {
 public:
  explicit LimitCheck(const std::string& file) : file_(file) {}

  bool null() override { return count(1); }
  bool boolean(bool) override { return count(1); }
  bool number_integer(number_integer_t) override { return count(1); }
  bool number_unsigned(number_unsigned_t) override { return count(1); }
  bool number_float(number_float_t, const string_t&) override { return count(1); }
  bool string(string_t&) override { return count(1); }
  bool binary(binary_t&) override { return count(1); }
  bool start_object(std::size_t) override { return open(); }
  bool key(string_t&) override { return true; }
  bool end_object() override { return close(); }
  bool start_array(std::size_t) override { return open(); }
  bool end_array() override { return close(); }
  bool parse_error(std::size_t byte, const std::string&,
                   const nlohmann::json::exception& error) override {
    if (dynamic_cast<const nlohmann::json::out_of_range*>(&error) != nullptr)
      throw InputError(file_, "", fmt::format("holds a number out of range: {}", error.what()));
    throw InputError(file_, fmt::format("byte {}", byte), "is not valid JSON",
                     "check the commas, brackets and quotes there");
  }

 private:
  bool count(std::size_t values) {
    values_ += values;
    if (values_ > max_values)
      throw InputError(file_, "", fmt::format("has more than {} values", max_values));
    return true;
  }
  bool open() {
    if (depth_++ >= max_depth)
      throw InputError(file_, "", fmt::format("is nested deeper than {}", max_depth));
    return count(2);
  }
  bool close() {
    --depth_;
    return true;
  }

  const std::string& file_;
  int depth_ = 0;
  std::size_t values_ = 0;
};

}  // namespace

nlohmann::json read_json(const ByteSource& file, std::uint64_t limit) {
  const std::vector<std::byte> bytes = file.read_all(limit);
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  LimitCheck check(file.name());
  nlohmann::json::sax_parse(text, &check);
  return nlohmann::json::parse(text);
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

std::size_t JsonField::size() const {
  if (!value_->is_array()) fail("is not an array");
  return value_->size();
}

JsonField JsonField::operator[](std::size_t index) const {
  assert(index < size());
  return JsonField(file_, fmt::format("{}[{}]", path_, index), value_->at(index));
}

float JsonField::number() const { return static_cast<float>(precise_number()); }

double JsonField::precise_number() const {
  if (!value_->is_number()) fail("is not a number");
  const auto number = value_->get<double>();
  if (!std::isfinite(static_cast<float>(number))) fail("is out of range");
  return number;
}

std::uint64_t JsonField::count() const {
  if (!value_->is_number_unsigned()) fail("is not a whole number from 0 on");
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
  for (std::size_t i = 0; i < expected_size; ++i) all.push_back((*this)[i].number());
  return all;
}

glm::dquat JsonField::orientation() const {
  const auto q = doubles<4>();
  return as_orientation({q[3], q[0], q[1], q[2]});
}

glm::dquat JsonField::as_orientation(const glm::dquat& q) const {
  if (!(std::abs(glm::length(q) - 1.0) <= 0.01)) fail("is no quaternion x, y, z, w of length 1");
  return glm::normalize(q);
}

glm::dvec3 JsonField::dvec3() const {
  const auto v = doubles<3>();
  return {v[0], v[1], v[2]};
}

glm::vec3 JsonField::as_position(const glm::dvec3& at, const glm::dvec3& origin) const {
  for (int k = 0; k < 3; ++k)
    if (!(std::abs(at[k]) <= static_cast<double>(max_coordinate)))
      fail(fmt::format("is not a position in a scene: beyond {} units", max_coordinate));
  return glm::vec3(at - origin);
}

}  // namespace catgs
