#pragma once

#include <functional>
#include <optional>
#include <ostream>
#include <string>

#include <gtest/gtest.h>

#include "render_core/base/error.h"

namespace catgs::test {

/// The InputError that `call` throws, if any.
inline std::optional<InputError> error_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const InputError& error) {
    return error;
  }
  return std::nullopt;
}

/// The InputError that `call` throws; fails the test when it throws none.
inline InputError expected_error(const std::function<void()>& call) {
  if (const auto error = error_of(call)) return *error;
  ADD_FAILURE() << "no InputError was thrown";
  return {"", "", ""};
}
inline std::string input_error(const std::function<void()>& call) {
  return expected_error(call).what();
}

/// The input that an error refuses, without the words for people.
struct Refusal {
  std::string source, where;

  bool operator==(const Refusal&) const = default;
};
inline void PrintTo(const Refusal& refusal, std::ostream* out) {
  *out << "{\"" << refusal.source << "\", \"" << refusal.where << "\"}";
}

inline Refusal refusal_of(const std::function<void()>& call) {
  const InputError error = expected_error(call);
  return {error.source(), error.where()};
}

}  // namespace catgs::test
