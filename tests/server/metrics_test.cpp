#include "server/metrics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace catgs {
namespace {

using testing::HasSubstr;
using testing::Not;

TEST(Metrics, ADeviceHasOneGaugeThatFollowsItsViews) {
  Metrics metrics;
  EXPECT_THAT(metrics.scrape(), Not(HasSubstr("catgs_device_views{")));
  metrics.set_views(0, 2);
  metrics.set_views(1, 3);
  metrics.set_views(0, 0);
  EXPECT_THAT(metrics.scrape(), HasSubstr("\ncatgs_device_views{device=\"0\"} 0\n"));
  EXPECT_THAT(metrics.scrape(), HasSubstr("\ncatgs_device_views{device=\"1\"} 3\n"));
  EXPECT_THAT(metrics.scrape(), Not(HasSubstr("{device=\"0\"} 2")));
}

}  // namespace
}  // namespace catgs
