#pragma once

#include <string>

#include "tests/load/run_scenario.h"

namespace catgs::load {

/// One page about a run, without anything from elsewhere: requirements, plots over time,
/// distributions, tables.
std::string to_html(const Scenario& scenario, const Outcome& outcome);

}  // namespace catgs::load
