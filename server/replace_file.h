#pragma once

#include <filesystem>
#include <string_view>

namespace catgs {

/// Puts `text` into `file` in one step: whoever reads it, also after a power cut, finds the old
/// text or the new one, whole. What was there is kept beside it under the name with `.bak`
/// appended; an older one of that name goes. Throws InputError that says what to do, and then
/// nothing has changed.
void replace_file(const std::filesystem::path& file, std::string_view text);

}  // namespace catgs
