#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "render_core/scene/splat_model.h"
#include "render_core/scene/usual_up.h"

namespace catgs {

/// The statements of a file about its model and up, in comments and fields of its exporter's own.
/// Case,
/// "_" and "-" do not count in them. They are read in the order of the file:
///
///   SplatRenderMode: mip                    Brush, gsplat, nerfstudio, splat-transform
///   SplatRenderMode: mip-0.1                NeRFICG
///   antialiased 1, postshot.anti_aliasing=1 Postshot
///   fvdb_ply_af_8198767135antialias|int64|1 fVDB
///   Vertical Axis: z                        nerfstudio (Brush says y of every scene)
struct ModelStatements {
  std::optional<SplatModel> model{};  // of the last statement that is understood
  std::vector<std::string> notes{};   // about those that are not, for people
  UsualUp usual_up = UsualUp::minus_y;

  void read(std::string_view text);
  /// Reads each member as "key: value". The member "model" is a statement, too.
  void read_members(const nlohmann::json& object);
};

}  // namespace catgs
