#include "render_core/scene/files/tour_check.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <initializer_list>
#include <string>
#include <string_view>
#include <system_error>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "render_core/base/error.h"
#include "render_core/math/camera.h"
#include "render_core/scene/files/media_name.h"

namespace catgs {
namespace {

// These limits must match web_client/src/tour/limits.ts; tests/web_client/tours.test.ts compares
// them.
constexpr std::size_t max_tours = 32;
constexpr std::size_t max_stops = 256;
constexpr std::size_t max_languages = 32;
constexpr std::size_t max_text_bytes = 16'000;  // 4000 characters
constexpr std::size_t max_media = 8;
constexpr std::size_t max_measures = 64;
constexpr std::size_t max_marks = 100;
constexpr std::size_t max_address_bytes = 2000;
constexpr float longest_stay_s = 3600;
constexpr float longest_flight_s = 120;

/// Refuses unknown members. Otherwise a typing error would go unnoticed, and nested values would be
/// unchecked.
void check_members(const JsonField& object, std::initializer_list<std::string_view> known) {
  static_cast<void>(object.find("title"));  // throws if it is no object
  for (const auto& [name, value] : object.value().items())
    if (std::ranges::find(known, name) == known.end())
      object.fail(fmt::format("unknown field '{}'", name),
                  fmt::format("known are {}", fmt::join(known, ", ")));
}

void check_text(const std::optional<JsonField>& field) {
  if (field && field->text().size() > max_text_bytes)
    field->fail(fmt::format("has more than {} bytes", max_text_bytes));
}

void check_number(const std::optional<JsonField>& field, float low, float high) {
  if (field && !(field->number() >= low && field->number() <= high))
    field->fail(fmt::format("is not in {}…{}", low, high));
}

/// Whether a text has the form of a BCP 47 tag, such as "de" or "zh-Hans".
bool is_language_tag(std::string_view tag) {
  const auto is_alphanumeric = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
  };
  std::size_t length = 0;  // of the part so far
  for (const char c : tag) {
    const bool ends_part = c == '-';
    if (ends_part ? length == 0 : !is_alphanumeric(c) || length == 8) return false;
    length = ends_part ? 0 : length + 1;
  }
  return length > 0 && tag.size() >= 2 && tag.size() <= 35;
}

/// Calls `check` with the language of each translation of `item`: {"de": {"title": …}}.
template <typename Check>
void for_translations(const JsonField& item, std::initializer_list<std::string_view> members,
                      const Check& check) {
  const auto translations = item.find("translations");
  if (!translations) return;
  static_cast<void>(translations->find("de"));  // throws if it is no object
  const nlohmann::json& languages = translations->value();
  if (languages.size() > max_languages)
    translations->fail(
        fmt::format("has {} languages, at most {}", languages.size(), max_languages));
  for (const auto& [tag, value] : languages.items()) {
    if (!is_language_tag(tag))
      translations->fail(fmt::format("'{}' is no language", tag), "a tag such as de or zh-Hans");
    const JsonField words = translations->at(tag);
    check_members(words, members);
    check(words);
  }
}

/// The kind of a medium: that of its `type`, or of the extension of its `src`.
MediaKind check_source(const JsonField& medium, const MediaOrigins* origins) {
  const JsonField source = medium.at("src");
  const std::string src = source.text();
  const bool is_address = src.find(':') != src.npos;
  if (!is_address && !is_media_name(src))
    source.fail("is no name of a file", "letters, digits, . - and _ alone, or an https address");
  if (is_address && !src.starts_with("https://")) source.fail("is no https address");
  const auto at_origin = [&](const std::string& origin) { return src.starts_with(origin + "/"); };
  const bool at_site = !origins || std::ranges::any_of(*origins, at_origin);
  if (is_address && (src.size() > max_address_bytes || !at_site))
    source.fail("is at no site that this server shows media of",
                "the operator names sites by --media-origin");
  const auto named = media_kind_named(src.substr(0, src.find_first_of("?#")));
  if (const auto type = medium.find("type")) {
    constexpr std::array<std::string_view, 3> kinds = {"image", "video", "audio"};
    const auto kind = std::ranges::find(kinds, type->text());
    if (kind == kinds.end()) type->fail("is not image, video or audio");
    const auto meant = static_cast<MediaKind>(kind - kinds.begin());
    if (!is_address && named != meant) type->fail("is not what the extension of src says");
    return meant;
  }
  if (!named) source.fail("has no extension that tells its kind", "give it a type: image");
  return *named;
}

void check_captions_of(const JsonField& medium) {
  const auto captions = medium.find("captions");
  if (!captions) return;
  const std::string name = captions->text();
  if (!is_media_name(name) || media_kind_named(name) != MediaKind::captions)
    captions->fail("is no name of a .vtt file");
}

/// Checks a voice or the sound of a tour, which may be another one in each language.
void check_sound(const JsonField& sound, const MediaOrigins* origins, bool has_captions) {
  const auto check = [&](const JsonField& spoken) {
    if (check_source(spoken, origins) != MediaKind::audio) spoken.at("src").fail("is no sound");
    if (has_captions) check_captions_of(spoken);
  };
  check(sound);
  const auto check_translation = [&](const JsonField& spoken) {
    if (spoken.find("src")) return check(spoken);
    if (spoken.find("type")) spoken.fail("has a type and no src");
    check_captions_of(spoken);
  };
  if (has_captions)
    for_translations(sound, {"src", "type", "captions"}, check_translation);
  else
    for_translations(sound, {"src", "type"}, check_translation);
}

void check_medium(const JsonField& medium, const MediaOrigins* origins) {
  check_members(medium, {"src", "type", "alt", "captions", "translations"});
  const MediaKind kind = check_source(medium, origins);
  if (kind == MediaKind::captions) medium.at("src").fail("is a file of captions");
  if (kind == MediaKind::image && medium.at("alt").text().empty())
    medium.at("alt").fail("is empty", "say what the picture shows, for those who do not see it");
  check_text(medium.find("alt"));
  for_translations(medium, {"alt", "captions"}, [](const JsonField& words) {
    check_text(words.find("alt"));
    check_captions_of(words);
  });
  check_captions_of(medium);
}

void check_view(const JsonField& view) {
  static_cast<void>(view.at("position").position());
  const auto target = view.find("look_at"), orientation = view.find("orientation");
  if (target)
    static_cast<void>(target->position());
  else if (orientation)
    static_cast<void>(orientation->orientation());
  else
    view.fail("'look_at' or 'orientation' is missing", "a place, or a quaternion x, y, z, w");
  check_number(view.find("fov_deg"), 5.0f, 160.0f);
}

/// Checks a number that counts from 1.
void check_ordinal(const std::optional<JsonField>& field, std::size_t most) {
  check_number(field, 1.0f, static_cast<float>(most));
  if (field && !field->value().is_number_integer()) field->fail("is no whole number");
}

/// Checks a way into another scene: to a view of it, to a stop of one of its tours, or to its
/// start.
void check_portal(const JsonField& portal) {
  check_members(portal, {"scene", "position", "look_at", "orientation", "fov_deg", "tour", "stop"});
  const JsonField scene = portal.at("scene");
  if (const std::size_t bytes = scene.text().size(); bytes == 0 || bytes > max_portal_bytes)
    scene.fail(fmt::format("is not 1 to {} bytes", max_portal_bytes));
  constexpr std::array<std::string_view, 4> of_view = {"position", "look_at", "orientation",
                                                       "fov_deg"};
  const bool to_view =
      std::ranges::any_of(of_view, [&](auto name) { return portal.find(name).has_value(); });
  if (to_view && (portal.find("tour") || portal.find("stop")))
    portal.fail("leads to a view and to a stop", "give position or stop");
  if (to_view) check_view(portal);
  check_ordinal(portal.find("tour"), max_tours);
  check_ordinal(portal.find("stop"), max_stops);
}

/// Checks an upright box, as --section has it.
void check_section(const JsonField& section) {
  constexpr std::size_t count = 7, first_side = 3, last_side = 5;
  if (!section.value().is_array() || section.size() != count)
    section.fail("is not [x, y, z, width, depth, height, turn_deg]");
  for (std::size_t i = 0; i < count; ++i) {
    const bool is_side = i >= first_side && i <= last_side;
    check_number(section[i], is_side ? 1e-5f : -max_coordinate, max_coordinate);
  }
}

void check_stop(const JsonField& stop, const MediaOrigins* origins) {
  check_members(stop, {"title", "caption", "translations", "position", "look_at", "orientation",
                       "fov_deg", "view_height", "section", "marker", "stay_s", "fly_s", "media",
                       "narration", "portal"});
  if (const auto media = stop.find("media")) {
    if (media->size() > max_media)
      media->fail(fmt::format("has {} entries, at most {}", media->size(), max_media));
    for (std::size_t i = 0; i < media->size(); ++i) check_medium((*media)[i], origins);
  }
  if (const auto narration = stop.find("narration")) {
    check_members(*narration, {"src", "type", "captions", "translations"});
    check_sound(*narration, origins, true);
  }
  check_text(stop.find("title"));
  check_text(stop.find("caption"));
  check_translations(stop, {"title", "caption"});
  check_view(stop);
  check_number(stop.find("view_height"), 1e-6f, max_coordinate);
  if (const auto section = stop.find("section")) check_section(*section);
  if (const auto marker = stop.find("marker")) static_cast<void>(marker->position());
  if (const auto portal = stop.find("portal")) check_portal(*portal);
  check_number(stop.find("stay_s"), 0.0f, longest_stay_s);
  check_number(stop.find("fly_s"), 0.0f, longest_flight_s);
}

void check_tour(const JsonField& tour, const MediaOrigins* origins) {
  check_members(tour, {"title", "translations", "autoplay", "sound", "stops"});
  if (const auto sound = tour.find("sound")) {
    check_members(*sound, {"src", "type", "volume", "translations"});
    check_sound(*sound, origins, false);
    check_number(sound->find("volume"), 0.0f, 1.0f);
  }
  check_text(tour.find("title"));
  check_translations(tour, {"title"});
  if (const auto autoplay = tour.find("autoplay"); autoplay && !autoplay->value().is_boolean())
    autoplay->fail("is not true or false");
  const JsonField stops = tour.at("stops");
  if (stops.size() > max_stops)
    stops.fail(fmt::format("has {} entries, at most {}", stops.size(), max_stops));
  for (std::size_t i = 0; i < stops.size(); ++i) check_stop(stops[i], origins);
}

void check_measure(const JsonField& measure) {
  check_members(measure, {"title", "translations", "marks"});
  check_text(measure.find("title"));
  check_translations(measure, {"title"});
  const JsonField marks = measure.at("marks");
  if (marks.size() < 2 || marks.size() > max_marks)
    marks.fail(fmt::format("has {} entries, 2 to {} make a measure", marks.size(), max_marks));
  for (std::size_t i = 0; i < marks.size(); ++i) {
    check_members(marks[i], {"position", "error", "depth"});
    static_cast<void>(marks[i].at("position").position());
    check_number(marks[i].find("error"), 0.0f, max_coordinate);
    if (const auto depth = marks[i].find("depth")) static_cast<void>(depth->position());
  }
}

void check_measures(const JsonField& measures) {
  if (measures.size() > max_measures)
    measures.fail(fmt::format("has {} entries, at most {}", measures.size(), max_measures));
  for (std::size_t i = 0; i < measures.size(); ++i) check_measure(measures[i]);
}

}  // namespace

void check_translations(const JsonField& item, std::initializer_list<std::string_view> texts) {
  for_translations(item, texts, [&](const JsonField& words) {
    for (const std::string_view text : texts) check_text(words.find(text));
  });
}

void check_page_fields(const JsonField& sidecar, const MediaOrigins* media_origins) {
  if (const auto measures = sidecar.find("measures")) check_measures(*measures);
  const auto tours = sidecar.find("tours");
  if (!tours) return;
  if (tours->size() > max_tours)
    tours->fail(fmt::format("has {} entries, at most {}", tours->size(), max_tours));
  for (std::size_t i = 0; i < tours->size(); ++i) check_tour((*tours)[i], media_origins);
}

std::optional<std::string> mistake_for_pages(const HintFiles& files) {
  std::error_code error;
  if (files.sidecar.empty() || !std::filesystem::is_regular_file(files.sidecar, error)) return {};
  try {
    const FileSource file(files.sidecar);
    const nlohmann::json document = read_json(file, max_sidecar_bytes);
    check_page_fields(JsonField(file.name(), document), nullptr);
  } catch (const InputError& mistake) {
    return fmt::format("{}{}", faulty_for_pages, mistake.what());
  }
  return std::nullopt;
}

}  // namespace catgs
