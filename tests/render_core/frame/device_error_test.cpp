#include "render_core/frame/device_error.h"

#include <gtest/gtest.h>

namespace catgs {
namespace {

using Code = RenderStatus::Code;

TEST(DeviceError, TellsADeviceThatFailedFromMemoryThatIsShort) {
  EXPECT_EQ(status_of(DeviceError(Code::device_failed, "blend")).code, Code::device_failed);
  EXPECT_EQ(status_of(DeviceError(Code::out_of_memory, "lists")).code, Code::out_of_memory);
  EXPECT_EQ(status_of(std::bad_alloc()).code, Code::out_of_memory);
  EXPECT_EQ(status_of(std::runtime_error("of an unknown kind")).code, Code::device_failed);
  EXPECT_EQ(status_of(DeviceError(Code::device_failed, "blend: lost")).message, "blend: lost");
}

}  // namespace
}  // namespace catgs
