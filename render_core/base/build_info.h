#pragma once

namespace catgs {

extern const char* const build_version;  // "0.1.0"
extern const char* const build_commit;   // "1a2b3c4d5e6f", "-dirty" behind local changes; "unknown"

}  // namespace catgs
