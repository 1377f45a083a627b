#pragma once

#include <string_view>

namespace catgs::load {

// Values with units as people write them, on the command line and in scenarios. Each throws
// InputError that names `source`, a flag or a key.

/// "30", "30s", "500ms", "2m", "1h": seconds.
double parse_duration_s(std::string_view source, std::string_view text);

/// "20mbit", "500kbit", "0": bits a second.
double parse_bits_per_s(std::string_view source, std::string_view text);

/// "1.5%" or "0.015": a share of 0…1.
double parse_share(std::string_view source, std::string_view text);

}  // namespace catgs::load
