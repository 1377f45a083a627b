#pragma once

#include <filesystem>
#include <string_view>

namespace catgs {

/// Replaces the content of `file` atomically. A reader finds the complete old or new text, even
/// after a power cut. The old file is kept with `.bak` appended to its name, in place of an earlier
/// one. On failure throws InputError with the remedy, and nothing has changed.
void replace_file(const std::filesystem::path& file, std::string_view text);

/// The same, but keeps no old file. Its errors suggest `remedy`.
void overwrite_file(const std::filesystem::path& file, std::string_view content,
                    std::string_view remedy);

}  // namespace catgs
