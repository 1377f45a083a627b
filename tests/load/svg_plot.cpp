#include "tests/load/svg_plot.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include <fmt/format.h>

#include "server/net/http.h"

namespace catgs::load {
namespace {

constexpr double width = 560.0, height = 240.0;
constexpr double left = 52.0, right = 22.0, top = 30.0, bottom = 46.0;
constexpr int colours = 6;  // classes c0…c5 of the page

struct Axis {
  double min = 0.0, max = 1.0, step = 0.2;
  bool logarithmic = false;

  /// 0…1 along the axis.
  [[nodiscard]] double place(double value) const {
    if (logarithmic) return std::log(value / min) / std::log(max / min);
    return (value - min) / (max - min);
  }
};

/// A range with about five steps of 1, 2 or 5 times a power of ten.
Axis round_axis(double max) {
  if (!(max > 0.0) || !std::isfinite(max)) return {};
  const double rough = max / 5.0;
  const double power = std::pow(10.0, std::floor(std::log10(rough)));
  const double digit = rough / power;
  const double step = power * (digit <= 1.0 ? 1.0 : digit <= 2.0 ? 2.0 : digit <= 5.0 ? 5.0 : 10.0);
  return {0.0, step * std::ceil(max / step - 1e-9), step, false};
}

Axis log_axis(double min, double max) {
  Axis axis{std::pow(10.0, std::floor(std::log10(min))), std::pow(10.0, std::ceil(std::log10(max))),
            10.0, true};
  if (axis.max <= axis.min) axis.max = 10.0 * axis.min;
  return axis;
}

std::vector<double> ticks(const Axis& axis) {
  std::vector<double> values;
  for (double value = axis.min; value <= axis.max * (1.0 + 1e-9);
       value = axis.logarithmic ? value * axis.step : value + axis.step) {
    values.push_back(value);
  }
  return values;
}

double x_of(const Axis& axis, double value) {
  return left + (width - left - right) * std::clamp(axis.place(value), 0.0, 1.0);
}

double y_of(const Axis& axis, double value) {
  return height - bottom - (height - top - bottom) * std::clamp(axis.place(value), 0.0, 1.0);
}

void draw_axes(const PlotSettings& settings, const Axis& x, const Axis& y, std::string& svg) {
  const auto out = std::back_inserter(svg);
  fmt::format_to(out, "<text class=\"title\" x=\"{}\" y=\"16\">{}</text>", left,
                 escape_html(settings.title));
  for (const double value : ticks(y)) {
    const double at = y_of(y, value);
    fmt::format_to(out,
                   "<line class=\"grid\" x1=\"{}\" y1=\"{:.1f}\" x2=\"{}\" y2=\"{:.1f}\"/>"
                   "<text x=\"{}\" y=\"{:.1f}\" text-anchor=\"end\">{:g}</text>",
                   left, at, width - right, at, left - 6, at + 4, value);
  }
  for (const double value : ticks(x)) {
    fmt::format_to(out, "<text x=\"{:.1f}\" y=\"{}\" text-anchor=\"middle\">{:g}</text>",
                   x_of(x, value), height - bottom + 16, value);
  }
  fmt::format_to(out, "<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{}</text>", width - right,
                 height - 10.0, escape_html(settings.x_unit));
  fmt::format_to(out, "<text x=\"{}\" y=\"16\" text-anchor=\"end\">{}</text>", width - right,
                 escape_html(settings.y_unit));
}

void draw_curve(const Curve& curve, int colour, const Axis& x, const Axis& y, std::string& svg) {
  std::string path;
  bool pen_down = false;
  for (const auto& [px, py] : curve.points) {
    const bool there = std::isfinite(py);
    if (there) {
      path += fmt::format("{}{:.1f} {:.1f}", pen_down ? "L" : "M", x_of(x, px), y_of(y, py));
    }
    pen_down = there;
  }
  svg += fmt::format("<path class=\"curve c{}\" d=\"{}\"/>", colour, path);
}

/// Names of the curves below the plot, one behind the other.
void draw_legend(const std::vector<Curve>& curves, std::string& svg) {
  double at = left;
  const double y = height - 10.0;
  for (std::size_t i = 0; i < curves.size(); ++i) {
    svg += fmt::format(
        "<line class=\"curve c{}\" x1=\"{:.0f}\" y1=\"{:.0f}\" x2=\"{:.0f}\" y2=\"{:.0f}\"/>"
        "<text x=\"{:.0f}\" y=\"{:.0f}\">{}</text>",
        i % colours, at, y - 4, at + 16, y - 4, at + 20, y, escape_html(curves[i].name));
    at += 38.0 + 6.4 * static_cast<double>(curves[i].name.size());
  }
}

}  // namespace

std::string line_plot(const PlotSettings& settings, const std::vector<Curve>& curves) {
  double min_x = INFINITY, max_x = 0.0, max_y = settings.max_y;
  for (const Curve& curve : curves) {
    for (const auto& [x, y] : curve.points) {
      if (x > 0.0) min_x = std::min(min_x, x);
      max_x = std::max(max_x, x);
      if (settings.max_y == 0.0 && std::isfinite(y)) max_y = std::max(max_y, y);
    }
  }
  if (settings.max_y == 0.0) {
    for (const double bound : settings.bounds) max_y = std::max(max_y, 1.1 * bound);
  }
  if (!std::isfinite(min_x)) return {};  // nothing was measured
  Axis x = settings.log_x ? log_axis(min_x, max_x) : round_axis(max_x);
  if (!settings.log_x) x.max = max_x;
  const Axis y = round_axis(max_y);
  std::string svg = fmt::format("<svg viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{}\">", width,
                                height, escape_html(settings.title));
  draw_axes(settings, x, y, svg);
  for (const double bound : settings.bounds) {
    svg += fmt::format("<line class=\"bound\" x1=\"{}\" y1=\"{:.1f}\" x2=\"{}\" y2=\"{:.1f}\"/>",
                       left, y_of(y, bound), width - right, y_of(y, bound));
  }
  for (std::size_t i = 0; i < curves.size(); ++i) {
    draw_curve(curves[i], static_cast<int>(i % colours), x, y, svg);
  }
  draw_legend(curves, svg);
  return svg + "</svg>\n";
}

}  // namespace catgs::load
