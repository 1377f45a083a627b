#pragma once

#include "tests/load/options.h"
#include "tests/load/run_report.h"

namespace catgs::load {

/// Runs the sessions to their end and returns their reports. Throws InputError on bad options.
RunReport run_load(const LoadOptions& options);

}  // namespace catgs::load
