#pragma once

// What nearly every test needs: GoogleTest with its matchers, literals of time, the standard
// library, and the field that an InputError names.

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <future>
#include <iterator>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <ranges>
#include <set>
#include <span>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "render_core/base/error.h"

namespace catgs {

using namespace std::chrono_literals;
using testing::AllOf;
using testing::AnyOf;
using testing::Contains;
using testing::Each;
using testing::ElementsAre;
using testing::EndsWith;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::MatchesRegex;
using testing::Not;
using testing::Optional;
using testing::SizeIs;
using testing::StartsWith;
using testing::Throws;
using testing::ThrowsMessage;
using testing::Truly;
using testing::UnorderedElementsAre;

namespace test {

/// The field that the InputError names which `call` throws, or its source where it names no field;
/// empty if it throws none. Its words are for people.
template <typename Call>
std::string refused_field(Call call) {
  try {
    call();
  } catch (const InputError& error) {
    return error.where().empty() ? error.source() : error.where();
  }
  return {};
}

}  // namespace test
}  // namespace catgs
