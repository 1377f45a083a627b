#include "render_core/base/new_file.h"

#include <system_error>

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "render_core/base/part_file.h"
#include "tests/support/temporary_folder.h"

namespace catgs {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

class NewFileTest : public testing::Test {
 protected:
  [[nodiscard]] std::ptrdiff_t files() const {
    return std::distance(fs::directory_iterator(folder_.path()), fs::directory_iterator());
  }

  const test::TemporaryFolder folder_;
  const fs::path path_ = folder_ / "report";
};

TEST_F(NewFileTest, WritersOfOnePathDoNotMeet) {
  PartFile first(path_), second(path_);
  first.stream() << "of the first, which is longer";
  second.stream() << "of the second";
  second.finish();
  EXPECT_EQ(test::content_of(path_), "of the second");
  first.finish();
  EXPECT_EQ(test::content_of(path_), "of the first, which is longer");
  EXPECT_EQ(files(), 1);
}

TEST_F(NewFileTest, LinksAndPipesAreReplacedAndNotOpened) {
  folder_.write("secret", "of somebody");
  fs::create_symlink(folder_ / "secret", folder_ / "link");
  ASSERT_EQ(::mkfifo((folder_ / "pipe").c_str(), 0600), 0);
  for (const char* name : {"link", "pipe"}) {
    PartFile file(folder_ / name, PartFile::Special::replaced);
    file.stream() << "new";
    file.finish();
    EXPECT_TRUE(fs::is_regular_file(fs::symlink_status(folder_ / name))) << name;
    EXPECT_EQ(test::content_of(folder_ / name), "new");
  }
  EXPECT_EQ(test::content_of(folder_ / "secret"), "of somebody");
}

TEST_F(NewFileTest, AFolderIsNotReplaced) {
  fs::create_directories(path_ / "inside");
  NewFile file(path_);
  EXPECT_THROW(file.become_target(), std::system_error);
  EXPECT_TRUE(fs::is_directory(path_ / "inside"));
  EXPECT_THROW(NewFile(folder_ / "absent/report"), std::system_error);
}

TEST_F(NewFileTest, AKilledWriterLeavesNothingThatStays) {
  int ready[2];
  ASSERT_EQ(::pipe(ready), 0);
  const pid_t writer = ::fork();
  if (writer == 0) {
    const NewFile file(path_);
    const bool written = ::write(file.descriptor(), "half", 4) == 4;
    ::_exit(written && ::write(ready[1], "!", 1) == 1 ? ::pause() : 1);
  }
  ::close(ready[1]);
  char byte = 0;
  ASSERT_EQ(::read(ready[0], &byte, 1), 1);
  ::kill(writer, SIGKILL);
  ::waitpid(writer, nullptr, 0);
  ::close(ready[0]);
  remove_stale_files(folder_.path(), 0h);
  EXPECT_EQ(files(), 0);
}

TEST_F(NewFileTest, StaleFilesOfItsNamesAloneAreRemoved) {
  const auto old = [&](const fs::path& file) {
    fs::last_write_time(file, fs::file_time_type::clock::now() - surely_stale - 1h);
    return file;
  };
  const fs::path stale = old(folder_.write(".hall.json.3f0c91d29b1deb4d.new", "half"));
  const fs::path live = folder_.write(".hall.json.3f0c91d29b1deb4e.new", "half");
  for (const char* other : {".hall.json.new", ".hall.json.3f0c91d29b1deb4.new", "hall.json",
                            "hall.json.3f0c91d29b1deb4d.new", ".hall.json.3F0c91d29b1deb4d.new"})
    old(folder_.write(other, "of somebody"));
  EXPECT_TRUE(is_name_of_new_file(stale));
  remove_stale_files(folder_.path(), surely_stale);
  EXPECT_FALSE(fs::exists(stale));
  EXPECT_TRUE(fs::exists(live)) << "another server may be writing it";
  EXPECT_EQ(files(), 6);
  remove_stale_files(folder_ / "absent", 0h);
}

}  // namespace
}  // namespace catgs
