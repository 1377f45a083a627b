#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "render_core/base/thread_pool.h"
#include "render_core/math/camera.h"
#include "render_core/scene/formats/byte_source.h"
#include "render_core/scene/gaussian_cloud.h"
#include "render_core/scene/orbit_limits.h"
#include "render_core/scene/scene.h"
#include "render_core/scene/usual_up.h"

namespace catgs {

struct ViewSample;

inline constexpr std::uint64_t max_sidecar_bytes = 4 << 20;

/// Hints that the author of a scene wrote down in `<scene>.json`. All fields are optional:
///
///   "up":         "-y", "+z", … or [x, y, z]
///   "start_pose": {"position": [x, y, z], "look_at": [x, y, z]}
///                 or {"position": [x, y, z], "orientation": [qx, qy, qz, qw]}
///   "near":       world units
///   "limits":     {"min": [x, y, z], "max": [x, y, z]}
///   "focus":      [x, y, z]
///   "title":      text of at most 800 bytes, as "credits" and "licence" are
///   "translations": {"de": {"title": …, "credits": …}, …}, by BCP 47 tags
///   "mode":       "orbit", "fly" or "walk": how a visitor moves at first
///   "background": "#rrggbb"
///   "metres_per_unit": length of a world unit
///   "model":      "default", "antialiased" or "2dgs", in place of what the scene's file says
///   "tours", "measures": for pages, see web_client/TOURS.md
///   "convert_hash": of all other fields as catgs-render convert wrote them, see is_unedited()
struct Sidecar {
  struct StartPose {
    glm::vec3 position{0.0f};
    std::optional<glm::vec3> look_at;
    glm::quat orientation{1.0f, 0.0f, 0.0f, 0.0f};  // when look_at is not given
  };
  std::optional<glm::vec3> up;  // unit
  std::optional<StartPose> start_pose;
  std::optional<float> near_z;
  std::optional<Bounds> limits;
  std::optional<glm::vec3> focus;
  SceneAbout about;
  std::optional<SplatModel> model;
  std::optional<std::string> unknown;  // about a field that is none of the above, for people
};

/// Throws InputError naming the field. An unknown field is no error, because a newer version or
/// another program may know it. Places are returned about `origin`.
Sidecar read_sidecar(const ByteSource& file, const glm::dvec3& origin = glm::dvec3(0.0));

/// Overwrites hints with the sidecar's fields; `about` is the sidecar's as a whole. `name`: name of
/// the sidecar's file.
void use_sidecar(const Sidecar& sidecar, const std::string& name, SceneHints& hints);

/// The path of a scene file's sidecar: "city.ply" -> "city.json".
std::filesystem::path sidecar_of(const std::filesystem::path& scene_file);

/// Whether a sidecar is as write_sidecar() has written it, so that nothing of an author is in it.
bool is_unedited(const std::filesystem::path& sidecar);

/// Writes all hints as a sidecar, and the fields for pages. Throws InputError when that fails.
void write_sidecar(const SceneHints& hints, const std::filesystem::path& path,
                   const nlohmann::ordered_json* page_fields = nullptr);

/// Files that may hold hints; empty paths are skipped.
struct HintFiles {
  std::filesystem::path sidecar;
  std::filesystem::path cameras;
  std::filesystem::path transforms;
  std::optional<OrbitLimits> orbit{};  // of the scene's file
  std::filesystem::path test_views{};  // transforms_test.json of a data set
  glm::dvec3 origin{0.0};              // of the scene; the files count from 0
  UsualUp usual_up = UsualUp::minus_y;
};

/// Whether they tell anything: a file is there, or an orbit.
bool tell_anything(const HintFiles& files);

/// Notes where an origin other than 0 is.
void note_origin(const glm::dvec3& origin, std::vector<std::string>& notes);

/// A place about `origin`, as the files beside a scene have it.
nlohmann::ordered_json json_location(const glm::vec3& point, const glm::dvec3& origin);

/// Nothing where there is no such file. Throws InputError for a faulty one.
std::optional<Sidecar> sidecar_at(const HintFiles& files);

/// The model that the sidecar names, if any. Throws InputError for a faulty sidecar.
std::optional<SplatModel> model_in_sidecar(const HintFiles& files);

/// Puts the model that `wanted` or else the sidecar names in place of the file's. Notes what people
/// should know about it. Throws InputError for a faulty sidecar.
void use_model(const HintFiles& files, const std::optional<SplatModel>& wanted, SplatModel& model,
               std::vector<std::string>& notes);

/// Keeps an estimate with what else is computed of a scene: tells that of before, or else calls
/// `estimate` and keeps the answer.
using KeepView = std::function<SceneHints(const std::function<SceneHints()>& estimate)>;

/// Takes each hint from the first source that has it: the sidecar; the training cameras (first
/// camera, levelled by find_up(), the box around them grown by half its diagonal); the orbit in the
/// scene's file, which narrows what estimate_hints() finds; estimate_hints(). `up` (unit) is for a
/// scene whose sidecar names none. `sample` is called unless `keep`, which may be null, knows. A
/// faulty sidecar throws InputError. Unusable camera files, which were not written for us, only add
/// a note.
SceneHints find_hints(const std::function<ViewSample()>& sample, const HintFiles& files,
                      const std::optional<glm::vec3>& up, std::vector<std::string>& notes,
                      std::shared_ptr<ThreadPool> pool, const KeepView& keep = {});

}  // namespace catgs
