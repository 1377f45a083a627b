#pragma once

#include <memory>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "tests/load/requirement.h"
#include "tests/load/session.h"

namespace catgs::load {

using SessionReports = std::vector<std::unique_ptr<SessionReport>>;

/// Every named result of a run: what --require may bound and what JSON and table show. Durations
/// are over the frames, poses or ticks of all sessions; rates are per session.
Metrics collect_metrics(const SessionReports& sessions, double nominal_fps);

nlohmann::ordered_json to_json(const SessionReports& sessions, const Metrics& metrics);

/// For people: one screen.
std::string to_table(const SessionReports& sessions, const Metrics& metrics);

}  // namespace catgs::load
