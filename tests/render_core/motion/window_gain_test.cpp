#include "render_core/motion/window_gain.h"

#include <gtest/gtest.h>

namespace catgs {
namespace {

/// Groups of a View whose frames take these times, and their decisions.
class Groups {
 public:
  /// Whether the group that begins gets a window. It lasts `frames`.
  bool next(int frames) {
    const bool window = gain_.begin_group(last_);
    if (window) {
      gain_.note_key(key_ms);
      for (int i = 1; i < frames; ++i) gain_.note_sub(sub_ms);
    } else {
      gain_.note_plain(plain_ms);
    }
    last_ = {.frames = frames, .window = window};
    return window;
  }
  int windows_of(int groups, int frames) {
    int windows = 0;
    for (int i = 0; i < groups; ++i) windows += next(frames) ? 1 : 0;
    return windows;
  }

  float plain_ms = 1.0f, key_ms = 1.25f, sub_ms = 0.7f;

 private:
  WindowGain gain_;
  WindowGain::Group last_;
};

TEST(WindowGain, LongGroupsPayAndShortOnesDoNot) {
  Groups lasting, short_lived;
  EXPECT_GT(lasting.windows_of(100, 6), 85);
  EXPECT_EQ(short_lived.windows_of(100, 1), 0);
}

TEST(WindowGain, GroupsOfTwoFramesPayWhereSubFramesAreCheap) {
  Groups groups;
  groups.sub_ms = 0.4f;
  groups.windows_of(2000, 2);  // a try now and then measures it
  EXPECT_GT(groups.windows_of(100, 2), 85);
}

TEST(WindowGain, FollowsGroupsThatBecomeShorter) {
  Groups groups;
  groups.windows_of(50, 8);
  groups.windows_of(20, 1);
  EXPECT_EQ(groups.windows_of(100, 1), 0);
}

TEST(WindowGain, AsksOfWindowsOnlyWhatTheyCostNow) {
  Groups groups;
  groups.windows_of(50, 8);
  for (float* ms : {&groups.plain_ms, &groups.key_ms, &groups.sub_ms}) *ms *= 5.0f;
  EXPECT_GT(groups.windows_of(100, 8), 85);
}

}  // namespace
}  // namespace catgs
