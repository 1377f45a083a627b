#include "server/base/scene_id.h"

#include <fmt/format.h>

#include "render_core/base/printable.h"

namespace catgs {
namespace {

constexpr std::string_view digits = "bcdfghjkmnpqrstv";  // each stands for four bits
constexpr std::size_t digest_letters = 8;

}  // namespace

bool is_scene_id(std::string_view text) {
  return !text.empty() && text.size() <= max_scene_id_bytes && text != "." && text != ".." &&
         printable(text) == text;
}

std::string scene_name_of(std::string_view name) {
  constexpr std::size_t max_name_bytes = 100;  // a digest has room behind it
  std::string text = shortened(printable(name), max_name_bytes);
  return is_scene_id(text) ? text : "scene";
}

std::string scene_id_of(std::string_view name, std::span<const unsigned char, 4> path_digest) {
  std::string id = scene_name_of(name) + '-';
  for (const unsigned char byte : path_digest) {
    id += digits[byte >> 4];
    id += digits[byte & 15];
  }
  return id;
}

bool belongs_to_path(std::string_view id) {
  if (id.size() < digest_letters + 2) return false;
  const std::string_view end = id.substr(id.size() - digest_letters - 1);
  return end.front() == '-' && end.find_first_not_of(digits, 1) == std::string_view::npos;
}

std::string_view name_in(std::string_view id) {
  return belongs_to_path(id) ? id.substr(0, id.size() - digest_letters - 1) : id;
}

std::string no_such_scene(std::string_view name) {
  if (belongs_to_path(name))
    return fmt::format(
        "there is no scene \"{}\" here: its file was moved or removed; ask for a new link", name);
  return fmt::format(
      "there is no scene \"{}\" here, or there are several of this name: ask for a new link", name);
}

}  // namespace catgs
