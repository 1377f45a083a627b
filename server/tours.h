#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "render_core/scene/files/hints.h"

namespace catgs {

/// What pages are told about tours through a scene, as JSON: {"tours": …, "settings": …, "etag":
/// …}. `tours` is that member of its sidecar (see hints.h) and `etag` the tag of all of it,
/// `settings` what the SuperSplat viewer keeps beside a scene: `<scene>.settings.json`, or
/// `settings.json` in its folder. Each is null where there is none. The page reads them; here they
/// are checked for size and syntax. Throws InputError for a mistake in the sidecar; a settings file
/// that cannot be used was not written for us: it is logged. `sidecar`: its path, whether it is
/// there or not.
std::string read_tours(const std::filesystem::path& sidecar);
/// The same where the sidecar has this text, or is not there.
std::string tours_of(const std::filesystem::path& sidecar, const std::optional<std::string>& text);

/// What pages get that ask for a scene's tours: {"may_save": …, "document": …}. Made once: it may
/// be megabytes, and everybody may ask as often as they like.
struct ToursAnswers {
  explicit ToursAnswers(std::string_view document = "{}");
  std::shared_ptr<const std::string> for_viewers;
  std::shared_ptr<const std::string> for_authors;
};

/// What is there now; nothing: no sidecar. Tag, hints and tours of one text belong together.
std::optional<std::string> sidecar_text(const std::filesystem::path& sidecar);

/// A sidecar that somebody sent. Stricter than what operators write: every field of its tours is
/// one that pages know, of the right kind and within its bounds. Throws InputError naming it.
Sidecar check_sent_sidecar(std::string_view json);

/// What check_sent_sidecar() takes at most; 32 tours of 256 stops with short captions.
inline constexpr std::size_t max_sent_sidecar_bytes = 1 << 20;

}  // namespace catgs
