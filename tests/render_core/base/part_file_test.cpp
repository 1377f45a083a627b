#include "render_core/base/part_file.h"

#include <string>

#include <gtest/gtest.h>

#include "tests/support/refusal.h"
#include "tests/support/temporary_folder.h"

namespace catgs {
namespace {

namespace fs = std::filesystem;

class PartFileTest : public testing::Test {
 protected:
  std::ptrdiff_t files() const {
    return std::distance(fs::directory_iterator(folder_.path()), fs::directory_iterator());
  }

  const test::TemporaryFolder folder_;
};

TEST_F(PartFileTest, TakesTheOldFilesPlaceWhenItIsFinished) {
  const fs::path path = folder_.write("report", "old");
  {
    PartFile file(path);
    file.stream() << "new";
    EXPECT_EQ(test::content_of(path), "old");
    file.finish();
    EXPECT_EQ(test::content_of(path), "new");
  }
  EXPECT_EQ(test::content_of(path), "new");
  EXPECT_EQ(files(), 1);
}

TEST_F(PartFileTest, LeavesTheOldFileWhereItIsNotFinished) {
  const fs::path path = folder_.write("report", "old");
  { PartFile(path).stream() << "half"; }
  EXPECT_EQ(test::content_of(path), "old");
  EXPECT_EQ(files(), 1);
}

TEST_F(PartFileTest, LeavesSymbolicLinksAsTheyAre) {
  const fs::path path = folder_.write("report", "old");
  fs::create_symlink(path, folder_ / "link");
  PartFile file(folder_ / "link");
  file.stream() << "new";
  file.finish();
  EXPECT_TRUE(fs::is_symlink(folder_ / "link"));
  EXPECT_EQ(test::content_of(path), "new");
}

TEST_F(PartFileTest, TakesNoDevicesPlace) {
  PartFile file("/dev/null");
  file.stream() << "new";
  file.finish();
  EXPECT_TRUE(fs::is_character_file("/dev/null"));
  PartFile full("/dev/full");
  full.stream() << "new";
  EXPECT_THROW(full.finish(), InputError);
}

TEST_F(PartFileTest, IsTriedBeforehandWithoutATrace) {
  EXPECT_NO_THROW(check_writable(folder_ / "report"));
  EXPECT_EQ(files(), 0);
  EXPECT_NO_THROW(check_writable(folder_.write("report", "old")));
  EXPECT_EQ(test::content_of(folder_ / "report"), "old");
  EXPECT_EQ(files(), 1);
  EXPECT_NO_THROW(check_writable("/dev/null"));
  const auto refusal = [](const fs::path& path) {
    return test::input_error([&] { check_writable(path); });
  };
  const std::string remedy = " (does the folder exist, and is there space?)";
  const fs::path nowhere = folder_ / "no/report";
  EXPECT_EQ(refusal(nowhere),
            nowhere.string() + ": cannot be written: No such file or directory" + remedy);
  EXPECT_EQ(refusal(folder_.path()),
            folder_.path().string() + ": is a folder (name a file, or remove the folder)");
}

}  // namespace
}  // namespace catgs
