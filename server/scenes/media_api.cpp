#include "server/scenes/media_api.h"

#include <algorithm>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "render_core/base/error.h"
#include "render_core/base/printable.h"
#include "server/base/log_event.h"
#include "server/base/replace_file.h"
#include "server/net/byte_range.h"
#include "server/scenes/scene_requests.h"

namespace catgs {
namespace {

/// The policy of a file that somebody opens by its address. Such a file can do nothing at all.
constexpr std::string_view file_policy = "default-src 'none'; sandbox";

HttpResponse not_there(std::string_view name) {
  return text_response(404, fmt::format("404: this scene has no picture, film or sound \"{}\"\n",
                                        is_media_name(name) ? name : ""));
}

/// The headers that all answers about a file have.
HttpResponse about_file(const MediaFile& file) {
  HttpResponse response;
  response.content_type = file.type->content_type;
  response.cache_control = "private, no-cache";
  response.etag = file.etag;
  response.accepts_ranges = true;
  response.policy = file_policy;
  return response;
}

/// A request for a file, kept until the disk was asked.
struct Wanted {
  std::string name, if_none_match, range, if_range;
};

/// May block.
HttpResponse answer_with(const MediaFolder& folder, const Wanted& wanted) {
  const std::optional<MediaFile> file = folder.find(wanted.name);
  if (!file) return not_there(wanted.name);
  HttpResponse response = about_file(*file);
  if (wanted.if_none_match == file->etag) {
    response.status = 304;
    return response;
  }
  std::optional<ByteRange> range;
  if (wanted.if_range.empty() || wanted.if_range == file->etag)
    range = requested_range(wanted.range, file->bytes);
  if (range && range->length == 0) {
    response.status = 416;
    response.content_range = fmt::format("bytes */{}", file->bytes);
    return response;
  }
  if (range) {
    response.status = 206;
    response.content_range = fmt::format("bytes {}-{}/{}", range->offset,
                                         range->offset + range->length - 1, file->bytes);
  }
  const auto [offset, length] = range.value_or(ByteRange{0, file->bytes});
  response.disk_body = std::make_shared<const DiskBody>(
      DiskBody{length, [folder, file = *file, begin = offset](std::uint64_t at, std::size_t bytes) {
                 return folder.read(file.name, file.etag, begin + at, bytes);
               }});
  return response;
}

/// May block.
HttpResponse listing_of(const MediaFolder& folder) {
  auto list = nlohmann::json::array();
  for (const MediaFile& file : folder.list())
    list.push_back({{"name", file.name}, {"type", file.type->content_type}, {"bytes", file.bytes}});
  return json_response(std::make_shared<const std::string>(nlohmann::json{{"media", list}}.dump()));
}

}  // namespace

std::optional<MediaFolder> MediaApi::folder_of(std::string_view scene_id) const {
  const auto listing = parts_.scenes.listing();
  const auto found = std::ranges::find(*listing, scene_id, &SceneLibrary::Listing::id);
  if (found == listing->end() || found->sidecar.empty()) return std::nullopt;
  return MediaFolder(found->sidecar);
}

bool MediaApi::has_pass(const HttpRequest& request, std::string_view scene_id) const {
  constexpr std::string_view argument = "pass=";
  const auto text = std::ranges::find_if(
      request.arguments, [&](const std::string& given) { return given.starts_with(argument); });
  if (text == request.arguments.end()) return false;
  const auto token = parts_.tokens.read_scene_pass(std::string_view(*text).substr(argument.size()),
                                                   scene_id, parts_.now_unix_s());
  return token && !parts_.ended(*token);
}

HttpResponse MediaApi::make_pass(const std::string& scene_id, const Permit& permit) const {
  return text_response(200, parts_.tokens.scene_pass(scene_id, permit, parts_.now_unix_s()));
}

HttpResponse MediaApi::list(const std::string& scene_id) const {
  const auto folder = folder_of(scene_id);
  HttpResponse response;
  if (!folder)
    response = json_response(std::make_shared<const std::string>(R"({"media":[]})"));
  else
    response.on_disk = [folder = *folder] { return listing_of(folder); };
  return response;
}

HttpResponse MediaApi::file(const HttpRequest& request, const std::string& scene_id,
                            const std::string& name) const {
  const auto folder = folder_of(scene_id);
  if (!folder || !is_media_name(name)) return not_there(name);
  HttpResponse response;
  response.on_disk = [folder = *folder,
                      wanted = Wanted{name, std::string(request.if_none_match),
                                      std::string(request.range), std::string(request.if_range)}] {
    return answer_with(folder, wanted);
  };
  return response;
}

std::optional<HttpResponse> MediaApi::refuse_upload(const std::string& scene_id,
                                                    std::string_view name) const {
  if (const OtherFormat* other = other_format(name, {}))
    return text_response(400,
                         fmt::format("400: \"{}\" is {}, which tours cannot show: save it as {}\n",
                                     printable(name), other->name, other->instead));
  if (!is_media_name(name) || !media_kind_named(name))
    return text_response(
        400, fmt::format("400: \"{}\" is no name of a picture, film or sound: use letters, digits, "
                         ". - and _, and an extension such as .jpg, .mp4, .mp3 or .vtt\n",
                         printable(name)));
  if (!folder_of(scene_id))
    return text_response(409, "409: the scene is no file in memory: open it, then try again\n");
  return std::nullopt;
}

std::future<HttpResponse> MediaApi::save(const HttpRequest& request, const std::string& scene_id,
                                         std::string name, std::string content,
                                         std::shared_ptr<const UploadSlot> slot) {
  auto answer = std::make_shared<std::promise<HttpResponse>>();
  auto future = answer->get_future();
  const auto folder = folder_of(scene_id);
  if (!folder) {
    answer->set_value(text_response(409, "409: the scene left the memory: open it again\n"));
    return future;
  }
  const auto write = [folder = *folder, scene_id, name = std::move(name),
                      precondition = Precondition{std::string(request.if_match),
                                                  std::string(request.if_none_match)}](
                         std::string_view bytes, const UploadSlot& of_sender) {
    try {
      const auto may_replace = [&](const std::string& etag) { return precondition.holds(etag); };
      if (!folder.save(name, bytes, may_replace, [&] { return !of_sender.abandoned(); }))
        return text_response(412, "412: another file has this name\n");
    } catch (const InputError& error) {
      log_warning({.event = "media_refused", .scene = scene_id},
                  "scene {}: an author's file was not kept: {}", scene_id, error.what());
      if (dynamic_cast<const FolderBusy*>(&error))
        return busy_response(fmt::format("503: {}\n", error.what()));
      return text_response(409, fmt::format("409: {}\n", error.what()));
    } catch (const std::exception& failure) {  // memory, say: it costs this file only
      log_error({.event = "save_failed", .scene = scene_id}, "scene {}: a file was not saved: {}",
                scene_id, failure.what());
      return text_response(500, "500: the server failed to save: try again\n");
    }
    log_info({.event = "media_saved", .scene = scene_id}, "scene {}: an author saved {} ({} bytes)",
             scene_id, name, bytes.size());
    return text_response(200, "saved\n");
  };
  jobs_.start(lanes.media, Priority::normal,
              [write, answer, content = std::move(content),
               slot = std::move(slot)](const std::stop_token&) mutable {
                HttpResponse response = busy_response("503: the connection is closed\n");
                if (!slot->abandoned()) response = write(content, *slot);
                std::string().swap(content);  // the slot is free before the answer comes
                slot.reset();
                answer->set_value(std::move(response));
              });
  return future;
}

}  // namespace catgs
