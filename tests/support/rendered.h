#pragma once

#include <vector>

#include <gtest/gtest.h>

#include "render_core/frame/renderer.h"
#include "tests/support/test_scenes.h"

namespace catgs::test {

/// A frame that outlives the View's next one.
struct Rendered {
  std::vector<float> rgb;
  FrameStats stats;
};

inline Rendered render_in(View& view, const FrameRequest& request) {
  FrameView frame;
  const RenderStatus status = view.render(request, frame);
  EXPECT_TRUE(status.ok()) << status.message;
  return {status.ok() ? copy_rgb(frame) : std::vector<float>(), frame.stats};
}

}  // namespace catgs::test
