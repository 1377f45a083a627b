#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

#include "tests/load/run_scenario.h"

namespace catgs::load {

/// A run as the document of charts.html: requirements, plots over time, distributions, tables.
nlohmann::ordered_json chart_document(const Scenario& scenario, const Outcome& outcome);

/// The charts.html of the built web client. Throws InputError if it was not built.
std::string read_charts_page();

/// The page with a document inside. It needs no server.
std::string with_document(std::string page, const nlohmann::ordered_json& document);

}  // namespace catgs::load
