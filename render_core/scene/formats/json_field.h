#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <glm/gtc/quaternion.hpp>
#include <glm/vec3.hpp>
#include <nlohmann/json_fwd.hpp>

#include "render_core/scene/formats/byte_source.h"

namespace catgs {

/// Parses a whole file as JSON. Throws InputError with the byte of a syntax error; files over
/// `limit` bytes, of more than 2^20 values or nested deeper than 256 are refused.
nlohmann::json read_json(const ByteSource& file, std::uint64_t limit);

/// `bytes` with U+FFFD in place of invalid UTF-8. File names may hold any bytes, JSON and the wire
/// may not.
std::string to_utf8(const std::string& bytes);

/// A value in a JSON document together with its path, so that every error names file and field:
/// "scene.json: limits.min[2]: is not a number". Borrows the document.
class JsonField {
 public:
  JsonField(std::string file, const nlohmann::json& value)
      : JsonField(std::move(file), "", value) {}

  /// Member `key`, which must exist and not be null.
  [[nodiscard]] JsonField at(std::string_view key) const;
  /// Member `key`; empty when it is missing or null.
  [[nodiscard]] std::optional<JsonField> find(std::string_view key) const;
  [[nodiscard]] std::size_t size() const;                       // of an array
  [[nodiscard]] JsonField operator[](std::size_t index) const;  // of an array; below its size

  [[nodiscard]] float number() const;           // finite
  [[nodiscard]] double precise_number() const;  // finite as a float too
  [[nodiscard]] std::uint64_t count() const;
  [[nodiscard]] std::string text() const;
  [[nodiscard]] glm::vec3 vec3() const { return glm::vec3(dvec3()); }
  [[nodiscard]] glm::dvec3 dvec3() const;
  /// Three coordinates, at most max_coordinate from 0 on each axis. Returned about `origin`.
  [[nodiscard]] glm::vec3 position(const glm::dvec3& origin = glm::dvec3(0.0)) const {
    return as_position(dvec3(), origin);
  }
  /// The place `at`, which this field stores in another form than place() reads.
  [[nodiscard]] glm::vec3 as_position(const glm::dvec3& at,
                                      const glm::dvec3& origin = glm::dvec3(0.0)) const;
  /// A unit quaternion x, y, z, w, to one percent; normalised.
  [[nodiscard]] glm::dquat orientation() const;
  /// The same for a quaternion that this field stores in another form.
  [[nodiscard]] glm::dquat as_orientation(const glm::dquat& q) const;
  [[nodiscard]] std::vector<float> numbers(std::size_t expected_size) const;

  /// Numbers of double precision, each finite as a float too.
  template <std::size_t Size>
  [[nodiscard]] std::array<double, Size> doubles() const {
    if (size() != Size) fail("is not an array of " + std::to_string(Size) + " numbers");
    std::array<double, Size> numbers;
    for (std::size_t i = 0; i < Size; ++i) numbers[i] = (*this)[i].precise_number();
    return numbers;
  }

  [[nodiscard]] const nlohmann::json& value() const { return *value_; }
  [[noreturn]] void fail(std::string_view what, std::string_view remedy = {}) const;

 private:
  JsonField(std::string file, std::string path, const nlohmann::json& value)
      : file_(std::move(file)), path_(std::move(path)), value_(&value) {}

  std::string file_, path_;
  const nlohmann::json* value_;
};

}  // namespace catgs
