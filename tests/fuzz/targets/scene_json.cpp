#include <algorithm>
#include <cmath>
#include <filesystem>

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "render_core/base/printable.h"
#include "render_core/scene/files/hints.h"
#include "render_core/scene/formats/camera_list.h"
#include "render_core/scene/formats/streamed_sog.h"
#include "server/films/film_request.h"
#include "server/scenes/tours.h"
#include "tests/fuzz/target.h"
#include "tests/support/temporary_folder.h"

namespace catgs::fuzz {
namespace {

bool is_position(const glm::vec3& v) {
  return std::abs(v.x) <= 1e9f && std::abs(v.y) <= 1e9f && std::abs(v.z) <= 1e9f;
}

void require_sound(const Pose& pose) {
  require(is_position(pose.position), "positions are places");
  require(std::abs(glm::length(pose.orientation) - 1.0f) < 1e-3f, "orientations have length 1");
}

void parse_lod_tree(Bytes input) {
  const LodTree tree = read_lod_tree(MemorySource("input", input));
  for (int level = 0; level < tree.levels; ++level) {
    const LodChoice choice = choose_level(tree, level);
    require(choice.pieces.size() <= tree.nodes.size(), "at most one piece of a node");
  }
  for (const std::size_t budget : {0, 10, 1 << 20})
    if (const auto choice = choose_within_budget(tree, budget))
      require(choice->count <= budget, "a budget is kept");
}

/// A tree of 64 nodes, whose costs are hard to sort; a budget of a million pays for a few of them.
std::string wide_lod_tree() {
  constexpr std::size_t coarse = (1 << 14) - 8;
  std::string nodes;
  for (const std::size_t cost : hard_to_sort(64))
    nodes += fmt::format(
        R"({}{{"lods":{{"0":{{"file":0,"offset":0,"count":{}}},"1":{{"file":0,"offset":0,"count":{}}}}}}})",
        nodes.empty() ? "" : ",", coarse + cost, coarse);
  return fmt::format(R"({{"lodLevels":2,"filenames":["a.sog"],"tree":{{"children":[{}]}}}})",
                     nodes);
}

std::map<std::string, std::string> lod_tree_seeds() {
  return {{"wide", wide_lod_tree()},
          {"two_levels",
           R"({"version":1,"lodLevels":2,"environment":null,"filenames":["0_0/meta.json"],"tree":{
               "bound":{"min":[0,0,0],"max":[1,1,1]},"children":[{"lods":{"0":{"file":0,"offset":0,
               "count":9},"1":{"file":0,"offset":9,"count":4}}},{"lods":{"1":{"file":0,"offset":13,
               "count":2}}}]}})"},
          {"environment",
           R"({"lodLevels":1,"environment":"env.sog","filenames":["a.sog"],"tree":{"lods":{}}})"}};
}

void parse_sidecar(Bytes input) {
  const Sidecar sidecar = read_sidecar(MemorySource("input", input));
  if (sidecar.up) require(std::abs(glm::length(*sidecar.up) - 1.0f) < 1e-3f, "up has length 1");
  if (sidecar.near_z)
    require(*sidecar.near_z > 0.0f && *sidecar.near_z <= 1e9f, "near is in front of the camera");
  if (sidecar.limits)
    require(is_position(sidecar.limits->min) && is_position(sidecar.limits->max),
            "limits are places");
  if (sidecar.focus) require(is_position(*sidecar.focus), "the focus is a place");
  const SceneAbout& about = sidecar.about;
  for (const std::string& text : {about.title, about.credits, about.licence})
    require(printable(text) == text, "texts for visitors are printable");
  require(about.translations.size() <= 32, "languages are bounded");
  for (const SceneWords& words : about.translations)
    require(printable(words.title + words.credits) == words.title + words.credits,
            "translations are printable");
  require(about.background_rgb <= 0xffffff, "the background is a colour");
  if (sidecar.start_pose)
    require_sound(Pose{sidecar.start_pose->position, sidecar.start_pose->orientation});
}

std::map<std::string, std::string> sidecar_seeds() {
  return {{"look_at", R"({"up":"+z","near":0.05,"focus":[1,2,3],"start_pose":{"position":[4,5,6],
                          "look_at":[0,0,0]},"limits":{"min":[0,0,0],"max":[1,1,1]}})"},
          {"orientation", R"({"up":[0,-1,0],"start_pose":{"position":[4,5,6],"orientation":
                              [0,0,0,1]},"tours":[]})"}};
}

void parse_cameras(Bytes input) {
  const CameraList list = read_camera_json(MemorySource("input", input));
  require(!list.rate_hz || *list.rate_hz > 0.0, "rates are positive");
  for (const ListedCamera& listed : list.cameras) {
    require_sound(listed.world_from_camera);
    require((listed.lens.size_px.x > 0) == (listed.lens.size_px.y > 0), "pictures have sides");
    if (!listed.lens.known()) continue;
    const Camera camera = make_camera(listed.lens, {64, 48});
    require(camera.focal_px.x >= 0.0f && camera.focal_px.y >= 0.0f, "lenses are whole");
  }
}

std::map<std::string, std::string> cameras_seeds() {
  return {
      {"cameras", R"([{"id":0,"img_name":"a","width":9,"height":9,"position":[-3,0,0],
                          "rotation":[[0,0,1],[0,1,0],[-1,0,0]],"fy":9.5,"fx":9.5}])"},
      {"transforms", R"({"camera_angle_x":0.6,"frames":[{"file_path":"a","transform_matrix":
                             [[1,0,0,1],[0,1,0,2],[0,0,1,3],[0,0,0,1]]}]})"},
      {"path", R"({"camera_type":"perspective","render_width":64,"render_height":48,"fps":24,
                       "camera_path":[{"camera_to_world":[1,0,0,1,0,1,0,2,0,0,1,3,0,0,0,1],"fov":50,
                       "aspect":1.3}],"seconds":4,"keyframes":[]})"},
      {"fisheye", R"({"camera_model":"OPENCV_FISHEYE","fl_x":40,"fl_y":41,"cx":31,"cy":23,"w":64,
                          "h":48,"k1":0.1,"k2":-2e-3,"x_fov":60,"is_fisheye":true,"frames":[]})"},
      {"export", R"([{"file_path":"a.png","transform":[[1,0,0,1],[0,1,0,2],[0,0,1,3]]}])"}};
}

/// Both names lead to one file in memory: writing files anew would take most of a run's time.
struct SidecarFolder {
  SidecarFolder() {
    spdlog::set_level(spdlog::level::off);  // a warning about nearly every input
    std::filesystem::create_symlink(file.path(), sidecar);
    std::filesystem::create_symlink(file.path(), folder / "a.settings.json");
  }
  FileInMemory file;
  test::TemporaryFolder folder;
  std::filesystem::path sidecar = folder / "a.json";
};

/// The sidecar's tours and the SuperSplat viewer's settings, as pages get them.
void parse_tours(Bytes input) {
  static SidecarFolder folder;
  folder.file.rewrite(input);
  require(tours_of(folder.sidecar, sidecar_text(folder.sidecar)).size() >=
              std::string(R"({"settings":,"tours":})").size(),
          "two parts");
}

/// What is taken from an author can be written, and read again as any sidecar.
void parse_sent_sidecar(Bytes input) {
  check_sent_sidecar(text_of(input));
  parse_sidecar(input);
  parse_tours(input);
}

std::map<std::string, std::string> sent_sidecar_seeds() {
  return {{"sent", R"({"up":"-y","near":0.1,"tours":[{"title":"Hall","autoplay":true,"stops":[{
                       "title":"Door","caption":"Oak.","position":[1,2,3],"orientation":[0,0,0,1],
                       "fov_deg":60,"marker":[1,2,4],"stay_s":8,"fly_s":2,
                       "portal":{"scene":"attic","stop":2}},
                       {"position":[0,1,2],"look_at":[0,0,0]}]}],
                       "measures":[{"title":"Gate","translations":{"de":{"title":"Tor"}},"marks":[
                       {"position":[0,0,4],"error":0.02,"depth":[0,0,0.1]},{"position":[1,0,4]}]}]})"}};
}

void parse_film(Bytes input) {
  const FilmRequest request = parse_film_request(text_of(input));
  require(!request.views.empty() && request.views.size() <= most_film_frames,
          "films begin and end");
  require(request.size_px.x >= 16 && request.size_px.x <= 8192, "pictures have a width");
  require(request.size_px.y >= 16 && request.size_px.y <= 4320, "pictures have a height");
  for (const FilmView& view : request.views) {
    require_sound(view.pose_about(glm::dvec3(0.0)));
    require(view.fov_y_rad > 0.08f && view.fov_y_rad < 2.8f, "fields of view are sane");
  }
}

std::map<std::string, std::string> film_seeds() {
  return {{"film", R"({"kind":"film","size":[1280,720],"views":[[1,2,3,0,0,0,1,60],30,
                       [4,5,6,0,0.6,0,0.8],2]})"},
          {"panorama", R"({"kind":"panorama","size":[4096,2048],"views":[[0,0,0,0,0,0,1,90]]})"}};
}

std::map<std::string, std::string> tours_seeds() {
  return {
      {"settings",
       R"({"version":2,"tours":[],"background":{"color":[0.4,0.4,0.4]},"animTracks":[{"name":"cameraAnim",
               "duration":5,"frameRate":30,"loopMode":"repeat","interpolation":"spline","keyframes":{
               "times":[0,60],"values":{"position":[2,1.5,-4,-2,1.5,-4],"target":[0,1,0,0,1,0],"fov":
               [75,60]}}}],"cameras":[{"initial":{"position":[2,2,-3],"target":[0,1,0],"fov":75}}],
               "annotations":[{"position":[1,2,3],"title":"A","text":"\u00e9"}]})"},
      {"tour", R"({"tours":[{"title":"Hall","stops":[{"title":"Door","position":[0,1,2],
                       "look_at":[0,0,0],"caption":"c","seconds":4}]}]})"}};
}

/// The keys of a format as documents have them, and what parsers of JSON err with.
std::vector<std::string> json_words(std::string_view keys) {
  std::vector<std::string> words = words_of(
      R"(null true false -0 1e400 1e39 [[[[ ]]]] {" ": \u0000 \ud800 18446744073709551616 -1 0.1)");
  for (const std::string& key : words_of(keys)) words.push_back(fmt::format("\"{}\":", key));
  return words;
}

}  // namespace

std::vector<Target> scene_json_targets() {
  return {{.name = "lod_tree",
           .parse = parse_lod_tree,
           .seeds = lod_tree_seeds,
           .dictionary = json_words(
               "lodLevels filenames tree children lods file offset count environment version"),
           .change = change_json,
           .max_bytes = 8192},
          {.name = "sidecar",
           .parse = parse_sidecar,
           .seeds = sidecar_seeds,
           .dictionary = json_words(
               "up near focus start_pose position look_at orientation limits min max tours title "
               "credits licence mode walk background #0a10ff translations de -y +z"),
           .change = change_json},
          {.name = "cameras",
           .parse = parse_cameras,
           .seeds = cameras_seeds,
           .dictionary = json_words(
               "position rotation frames transform_matrix camera_path camera_to_world fov "
               "fl_x camera_angle_x w h cx transform fps seconds"),
           .change = change_json},
          {.name = "tours",
           .parse = parse_tours,
           .seeds = tours_seeds,
           .dictionary = json_words("tours measures animTracks annotations cameras"),
           .change = change_json,
           .max_bytes = 65536},
          {.name = "film_wish",
           .parse = parse_film,
           .seeds = film_seeds,
           .dictionary = json_words("kind size views film picture panorama"),
           .change = change_json,
           .max_bytes = 65536},
          {.name = "sent_sidecar",
           .parse = parse_sent_sidecar,
           .seeds = sent_sidecar_seeds,
           .dictionary = json_words(
               "tours stops title caption autoplay fov_deg marker stay_s fly_s portal scene "
               "position look_at orientation up measures marks error depth"),
           .change = change_json,
           .max_bytes = 65536}};
}

}  // namespace catgs::fuzz
