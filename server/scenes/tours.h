#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "render_core/scene/files/hints.h"
#include "render_core/scene/files/tour_check.h"
#include "render_core/scene/files/tour_titles.h"

namespace catgs {

/// Returns what pages get about a scene's tours, as JSON:
/// {"tours": …, "measures": …, "settings": …, "etag": …}.
/// - `tours` and `measures` are members of the scene's sidecar (see hints.h), and `etag` is the tag
///   of the whole sidecar;
/// - `settings` is the SuperSplat viewer's file: `<scene>.settings.json`, or `settings.json` in the
///   scene's folder.
/// A missing one is null. Throws InputError where size or syntax of the sidecar are wrong. The page
/// reads them as far as it can, so a mistake that check_page_fields() finds in them is only logged.
/// So is an unusable settings file, which was not written for us. `sidecar` is the sidecar's path,
/// even if there is no file. `text` is its content, if any.
std::string tours_of(const std::filesystem::path& sidecar, const std::optional<std::string>& text,
                     const MediaOrigins& media_origins = {});

/// The answers to requests for a scene's tours: {"may_save": …, "document": …}. They are made once,
/// because they may be megabytes and are requested often.
struct ToursAnswers {
  explicit ToursAnswers(std::string_view document = "{}");
  std::shared_ptr<const std::string> for_viewers;
  std::shared_ptr<const std::string> for_authors;
  std::shared_ptr<const std::vector<TourTitles>> titles;

  /// True if the scene has this stop. Tours and stops count from 0.
  [[nodiscard]] bool has_stop(std::size_t tour, std::size_t stop) const {
    return tour < titles->size() && stop < (*titles)[tour].stops.size();
  }
};

/// The current content of the sidecar; nothing: no sidecar. Tag, hints and tours must come from the
/// same text.
std::optional<std::string> sidecar_text(const std::filesystem::path& sidecar);

/// Checks a sidecar sent by an author. It is stricter than for operators' files: every field must
/// be known, and check_page_fields() finds no mistake. Throws InputError that names the field. Its
/// places are returned about `origin`.
Sidecar check_sent_sidecar(std::string_view json, const MediaOrigins& media_origins = {},
                           const glm::dvec3& origin = glm::dvec3(0.0));

/// The size limit of check_sent_sidecar(): 32 tours of 256 stops with short captions.
inline constexpr std::size_t max_sent_sidecar_bytes = 1 << 20;

}  // namespace catgs
