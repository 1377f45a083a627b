#pragma once

#include <cstdint>

namespace catgs::test {

inline constexpr std::int64_t noon = 1'764'072'000;  // 2025-11-25 12:00:00 UTC
inline constexpr std::int64_t day_s = 86'400;
inline constexpr const char* today = "2025-11-25";

}  // namespace catgs::test
