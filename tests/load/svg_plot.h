#pragma once

#include <string>
#include <utility>
#include <vector>

namespace catgs::load {

/// Drawings for an HTML page: inline SVG that takes its colours from the page's style sheet.

struct Curve {
  std::string name;
  std::vector<std::pair<double, double>> points;  // (x, y); a NaN interrupts the curve
};

struct PlotSettings {
  std::string title{};
  std::string x_unit{}, y_unit{};
  double max_y = 0.0;            // 0: as the curves need
  std::vector<double> bounds{};  // horizontal lines: what must not be exceeded
  bool log_x = false;
};

/// Curves in one frame with axes and a legend.
std::string line_plot(const PlotSettings& settings, const std::vector<Curve>& curves);

}  // namespace catgs::load
