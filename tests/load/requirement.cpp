#include "tests/load/requirement.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iterator>

#include <fmt/format.h>

#include "render_core/base/error.h"

namespace catgs::load {
namespace {

std::string_view trim(std::string_view text) {
  const std::size_t begin = std::min(text.find_first_not_of(" \t"), text.size());
  const std::size_t end = text.find_last_not_of(" \t");
  return begin == text.size() ? std::string_view() : text.substr(begin, end - begin + 1);
}

}  // namespace

Requirement::Requirement(std::string_view text) : text_(text) {
  // Longer operators first: "<=" begins with "<".
  static const std::pair<std::string_view, Comparison> operators[] = {
      {"<=", std::less_equal<>()},   {">=", std::greater_equal<>()}, {"==", std::equal_to<>()},
      {"!=", std::not_equal_to<>()}, {"<", std::less<>()},           {">", std::greater<>()}};
  const std::size_t at = std::min(text.find_first_of("<>=!"), text.size());
  const std::string_view rest = text.substr(at);
  const auto found = std::ranges::find_if(
      operators, [&](const auto& entry) { return rest.starts_with(entry.first); });
  metric_ = trim(text.substr(0, at));
  bool good = found != std::end(operators) && !metric_.empty();
  if (good) {
    compare_ = found->second;
    const std::string_view number = trim(rest.substr(found->first.size()));
    const char* end = number.data() + number.size();
    const auto [stop, error] = std::from_chars(number.data(), end, bound_);
    good = error == std::errc() && stop == end && std::isfinite(bound_);
  }
  if (!good) {
    throw InputError("--require", "", fmt::format("\"{}\" is not METRIC OP NUMBER", text),
                     "like 'pose_to_frame_p95_ms<33'; OP is one of < <= > >= == !=");
  }
}

void Requirement::check_name(const Metrics& metrics) const {
  std::string names;
  for (const auto& [name, value] : metrics) {
    if (name == metric_) return;
    names += fmt::format("{}{}", names.empty() ? "" : ", ", name);
  }
  throw InputError("--require", "", fmt::format("unknown metric \"{}\"", metric_),
                   fmt::format("one of {}", names));
}

double Requirement::value(const Metrics& metrics) const { return value_of(metrics, metric_); }

bool Requirement::holds(const Metrics& metrics) const { return compare_(value(metrics), bound_); }

std::string Requirement::explain(const Metrics& metrics) const {
  return fmt::format("{}: is {:.6g}", text_, value(metrics));
}

}  // namespace catgs::load
