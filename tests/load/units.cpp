#include "tests/load/units.h"

#include <charconv>
#include <cmath>
#include <span>
#include <utility>

#include <fmt/format.h>

#include "render_core/base/error.h"

namespace catgs::load {
namespace {

using Unit = std::pair<std::string_view, double>;

/// A number of at least 0 and one of the units behind it.
double parse(std::string_view source, std::string_view text, std::span<const Unit> units,
             std::string_view what, std::string_view examples) {
  double value = 0.0;
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  if (error == std::errc() && value >= 0.0 && std::isfinite(value)) {
    const std::string_view unit(stop, static_cast<std::size_t>(end - stop));
    for (const auto& [name, factor] : units) {
      if (unit == name) return value * factor;
    }
  }
  throw InputError(source, "", fmt::format("\"{}\" is not {}", text, what), examples);
}

}  // namespace

double parse_duration_s(std::string_view source, std::string_view text) {
  constexpr Unit units[] = {{"ms", 1e-3}, {"s", 1.0}, {"m", 60.0}, {"h", 3600.0}, {"", 1.0}};
  return parse(source, text, units, "a duration", "like 30s, 500ms or 2m");
}

double parse_bits_per_s(std::string_view source, std::string_view text) {
  constexpr Unit units[] = {{"kbit", 1e3}, {"mbit", 1e6}, {"gbit", 1e9}};
  if (text == "0") return 0.0;
  return parse(source, text, units, "a rate", "like 20mbit, 500kbit, or 0 for an outage");
}

double parse_share(std::string_view source, std::string_view text) {
  constexpr Unit units[] = {{"%", 1e-2}, {"", 1.0}};
  const double share = parse(source, text, units, "a share", "like 1% or 0.01");
  if (share <= 1.0) return share;
  throw InputError(source, "", fmt::format("\"{}\" is more than all", text), "at most 100%");
}

}  // namespace catgs::load
