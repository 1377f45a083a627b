#include "server/base/replace_file.h"

#include <fstream>
#include <iterator>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "render_core/base/error.h"
#include "tests/support/temporary_folder.h"

namespace catgs {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;
using testing::UnorderedElementsAre;

class ReplaceFile : public testing::Test {
 protected:
  static std::string read(const fs::path& file) {
    std::ifstream in(file);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  [[nodiscard]] std::vector<std::string> names() const {
    std::vector<std::string> all;
    for (const auto& entry : fs::directory_iterator(folder.path()))
      all.push_back(entry.path().filename().string());
    return all;
  }
  const test::TemporaryFolder folder;
  const fs::path file = folder / "hall.json";
};

TEST_F(ReplaceFile, KeepsThePreviousOneOnce) {
  replace_file(file, "first");
  EXPECT_THAT(names(), UnorderedElementsAre("hall.json"));
  replace_file(file, "second");
  replace_file(file, "third");
  EXPECT_EQ(read(file), "third");
  EXPECT_EQ(read(folder / "hall.json.bak"), "second");
  EXPECT_THAT(names(), UnorderedElementsAre("hall.json", "hall.json.bak"));
}

TEST_F(ReplaceFile, KeepsThePermissions) {
  folder.write("hall.json", "old");
  fs::permissions(file, fs::perms::owner_read | fs::perms::owner_write | fs::perms::group_read);
  replace_file(file, "new");
  EXPECT_EQ(fs::status(file).permissions(),
            fs::perms::owner_read | fs::perms::owner_write | fs::perms::group_read);
}

/// Whoever opened the old one reads on in it: it is another file by now, not one cut short.
TEST_F(ReplaceFile, DisturbsNoReader) {
  replace_file(file, "first");
  std::ifstream reader(file);
  replace_file(file, "a longer text than before");
  EXPECT_EQ(std::string(std::istreambuf_iterator<char>(reader), {}), "first");
}

TEST_F(ReplaceFile, ChangesNothingWhereItFails) {
  EXPECT_THAT([&] { replace_file(folder / "absent" / "hall.json", "text"); },
              ThrowsMessage<InputError>(HasSubstr("hall.json: cannot be written")));
  fs::create_directories(folder / "taken.json" / "inside");
  EXPECT_THROW(replace_file(folder / "taken.json", "text"), InputError);
  EXPECT_TRUE(fs::is_directory(folder / "taken.json"));
  EXPECT_FALSE(fs::exists(folder / ".taken.json.new"));
}

TEST_F(ReplaceFile, SaysThatAFolderIsReadOnly) {
  // Root may write to every folder, but not there.
  EXPECT_THAT([] { replace_file("/sys/hall.json", "text"); },
              ThrowsMessage<InputError>(AllOf(HasSubstr("the folder is read-only for the server"),
                                              HasSubstr("download the file"))));
}

}  // namespace
}  // namespace catgs
