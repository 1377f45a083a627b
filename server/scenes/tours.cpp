#include "server/scenes/tours.h"

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <system_error>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "render_core/base/error.h"
#include "render_core/scene/formats/json_field.h"
#include "server/base/log_event.h"
#include "server/base/scene_id.h"
#include "server/net/http.h"

namespace catgs {
namespace {

constexpr std::uint64_t max_bytes = 4 << 20;
static_assert(max_portal_bytes == max_scene_id_bytes);

bool is_file(const std::filesystem::path& file) {
  std::error_code error;
  return std::filesystem::is_regular_file(file, error);
}

void add_page_fields(const std::filesystem::path& sidecar, std::string_view text,
                     const MediaOrigins& media_origins, nlohmann::json& to) {
  const MemorySource file(sidecar.string(), std::as_bytes(std::span(text)));
  const nlohmann::json document = read_json(file, max_bytes);
  const JsonField root(file.name(), document);
  for (const char* name : {"tours", "measures"})
    if (const auto field = root.find(name)) {
      static_cast<void>(field->size());  // throws if it is no array
      to[name] = field->value();
    }
  try {
    check_page_fields(root, &media_origins);
  } catch (const InputError& mistake) {
    log_warning({.event = "tours_faulty"}, "{}{}", faulty_for_pages, mistake.what());
  }
}

nlohmann::json viewer_settings(const std::filesystem::path& sidecar) {
  const std::array candidates = {std::filesystem::path(sidecar).replace_extension(".settings.json"),
                                 sidecar.parent_path() / "settings.json"};
  for (const auto& path : candidates) {
    if (!is_file(path)) continue;
    try {
      nlohmann::json settings = read_json(FileSource(path), max_bytes);
      // Many programs write a settings.json. The viewer's file has animation tracks.
      if (settings.is_object() && settings.contains("animTracks")) return settings;
    } catch (const InputError& error) {
      log_warning({.event = "tours_unreadable"}, "no tours from it: {}", error.what());
    }
  }
  return nullptr;
}

}  // namespace

Sidecar check_sent_sidecar(std::string_view json, const MediaOrigins& media_origins,
                           const glm::dvec3& origin) {
  const MemorySource source("sidecar", std::as_bytes(std::span(json)));
  const nlohmann::json document = read_json(source, max_sent_sidecar_bytes);
  Sidecar sidecar = read_sidecar(source, origin);
  if (sidecar.unknown) throw InputError(source.name(), "", *sidecar.unknown);
  check_page_fields(JsonField(source.name(), document), &media_origins);
  return sidecar;
}

std::string tours_of(const std::filesystem::path& sidecar, const std::optional<std::string>& text,
                     const MediaOrigins& media_origins) {
  nlohmann::json document{{"tours", nullptr},
                          {"measures", nullptr},
                          {"etag", nullptr},
                          {"settings", viewer_settings(sidecar)}};
  if (text) {
    add_page_fields(sidecar, *text, media_origins, document);
    document["etag"] = etag_of(*text);
  }
  return document.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

ToursAnswers::ToursAnswers(std::string_view document)
    : titles(std::make_shared<const std::vector<TourTitles>>(titles_of_tours(document))) {
  const auto answer = [&](bool may_save) {
    return std::make_shared<const std::string>(
        fmt::format(R"({{"may_save":{},"document":{}}})", may_save, document));
  };
  for_viewers = answer(false);
  for_authors = answer(true);
}

std::optional<std::string> sidecar_text(const std::filesystem::path& sidecar) {
  if (!is_file(sidecar)) return std::nullopt;
  const std::vector<std::byte> bytes = FileSource(sidecar).read_all(max_bytes);
  return std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size());
}

}  // namespace catgs
