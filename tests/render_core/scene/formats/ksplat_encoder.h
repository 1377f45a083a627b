#pragma once

#include <cstddef>
#include <string>

#include "render_core/scene/gaussian_cloud.h"

namespace catgs::test {

struct KsplatStyle {
  int level = 0;
  std::size_t sections = 2;      // of Gaussians; an empty one stands between them
  std::size_t bucket_rows = 16;  // of a full bucket; the rest is in two buckets of any length
};

/// Written from the description of .ksplat, independently of the reader. SH degree at most 2.
std::string encode_ksplat(const GaussianCloud& cloud, const KsplatStyle& style = {});

}  // namespace catgs::test
