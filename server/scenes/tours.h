#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "render_core/scene/files/hints.h"

namespace catgs {

/// Returns what pages get about a scene's tours, as JSON: {"tours": …, "settings": …, "etag": …}.
/// - `tours` is that member of the scene's sidecar (see hints.h), and `etag` is the tag of the
///   whole sidecar;
/// - `settings` is the SuperSplat viewer's file: `<scene>.settings.json`, or `settings.json` in the
///   scene's folder.
/// A missing one is null. Only size and syntax are checked here; the page reads the content. Throws
/// InputError for a mistake in the sidecar. An unusable settings file was not written for us, so it
/// is only logged. `sidecar` is the sidecar's path, even if there is no file. `text` is its
/// content, if any.
std::string tours_of(const std::filesystem::path& sidecar, const std::optional<std::string>& text);

/// The answers to requests for a scene's tours: {"may_save": …, "document": …}. They are made once,
/// because they may be megabytes and are requested often.
struct ToursAnswers {
  explicit ToursAnswers(std::string_view document = "{}");
  std::shared_ptr<const std::string> for_viewers;
  std::shared_ptr<const std::string> for_authors;
};

/// The current content of the sidecar; nothing: no sidecar. Tag, hints and tours must come from the
/// same text.
std::optional<std::string> sidecar_text(const std::filesystem::path& sidecar);

/// Checks a sidecar sent by an author. It is stricter than for operators' files: every field of its
/// tours must be known, of the right type and within bounds. Media are files of the scene's folder,
/// or addresses at `media_origins`. Throws InputError that names the field.
Sidecar check_sent_sidecar(std::string_view json,
                           const std::vector<std::string>& media_origins = {});

/// The size limit of check_sent_sidecar(): 32 tours of 256 stops with short captions.
inline constexpr std::size_t max_sent_sidecar_bytes = 1 << 20;

}  // namespace catgs
