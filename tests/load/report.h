#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

#include "render_core/tools/table.h"
#include "tests/load/metrics.h"

namespace catgs::load {

/// The first session that was; null if none was.
const SessionReport* admitted(const SessionReports& sessions);

nlohmann::ordered_json to_json(const RunReport& report, const Metrics& metrics,
                               const HoldBounds& bounds);

/// The table of --glass: a row for each group that was judged.
PaperTable display_table(const RunReport& report, const HoldBounds& bounds);

/// For people: one screen for each group, or the table of displays.
std::string to_table(const RunReport& report, const HoldBounds& bounds);

}  // namespace catgs::load
