#pragma once

namespace catgs {

/// Which way up usually is in files like a scene's: -y; y or -y alike, because writers differ; or
/// z, because the writer said so.
enum class UsualUp { minus_y, either_y, plus_z };

}  // namespace catgs
