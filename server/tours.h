#pragma once

#include <filesystem>
#include <string>

namespace catgs {

/// What pages are told about tours through a scene, as JSON: {"tours": …, "settings": …}. `tours`
/// is that member of its sidecar (see hints.h), `settings` what the SuperSplat viewer keeps beside
/// a scene: `<scene>.settings.json`, or `settings.json` in its folder. Either is null where there
/// is none. The page reads them; here they are checked for size and syntax. Throws InputError for a
/// mistake in the sidecar; a settings file that cannot be used was not written for us: it is
/// logged.
std::string read_tours(const std::filesystem::path& scene);

}  // namespace catgs
