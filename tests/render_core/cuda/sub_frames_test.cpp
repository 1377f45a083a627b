// Key frames and sub-frames of the CUDA core; needs a device.

#include "tests/support/catgs_view_tests.h"

namespace catgs::test {

// Where a tile's list is cut depends on the View's last frame, and rounding on the cut.
INSTANTIATE_TEST_SUITE_P(Cuda, CatgsView, testing::Values(Core{RendererKind::cuda, 60.0, 60.0}));

}  // namespace catgs::test
