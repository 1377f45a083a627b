#include "server/base/replace_file.h"

#include "tests/support/temporary_folder.h"
#include "tests/support/test.h"

namespace catgs {
namespace {

namespace fs = std::filesystem;

void replace_file(const fs::path& file, std::string_view text) {
  Replacement(file, text, beside_the_scene).take_place_and_keep_old();
}

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
  EXPECT_THAT([&] { replace_file(folder / "taken.json", "text"); },
              ThrowsMessage<InputError>("taken.json: is a folder (have the folder removed)"));
  EXPECT_TRUE(fs::is_directory(folder / "taken.json"));
  EXPECT_THAT(names(), UnorderedElementsAre("taken.json"));
}

TEST_F(ReplaceFile, SaysThatAFolderIsReadOnly) {
  // Root may write to every folder, but not there.
  EXPECT_THAT([] { replace_file("/sys/hall.json", "text"); },
              ThrowsMessage<InputError>(AllOf(HasSubstr("the folder is read-only for the server"),
                                              HasSubstr("download the file"))));
}

TEST_F(ReplaceFile, ReadersFindACompleteFileWhoeverWrites) {
  constexpr int rounds = 300;
  const std::string longer(50'000, 'l'), shorter(10'000, 's');
  overwrite_file(file, longer, "");
  std::atomic<int> writers{2}, refused{0};
  const auto write = [&](const std::string& text) {
    for (int i = 0; i < rounds; ++i) {
      try {
        overwrite_file(file, text, "");
      } catch (const InputError&) {
        ++refused;
      }
    }
    --writers;
  };
  std::thread one(write, longer), other(write, shorter);
  int torn = 0;
  while (writers > 0) {
    const std::string text = read(file);
    torn += text != longer && text != shorter ? 1 : 0;
  }
  one.join();
  other.join();
  EXPECT_EQ(torn, 0);
  EXPECT_EQ(refused, 0);
  EXPECT_THAT(names(), UnorderedElementsAre("hall.json"));
}

TEST_F(ReplaceFile, AFolderIsSavedInByOneAtATime) {
  std::optional<FileLock> first = lock_for_saving(folder.path());
  EXPECT_THAT([&] { lock_for_saving(folder.path(), 10ms); },
              ThrowsMessage<FolderBusy>(HasSubstr("another server saves in this folder")));
  std::thread other([&] { lock_for_saving(folder.path()); });
  first.reset();
  other.join();
  EXPECT_NO_THROW(lock_for_saving(folder.path(), 0ms));
}

/// A server that stops, or whose author has gone, waits for no other one.
TEST_F(ReplaceFile, WaitForALockEndsWithTheNeedForIt) {
  const FileLock held = lock_for_saving(folder.path());
  int looks = 0;
  EXPECT_THROW(lock_for_saving(folder.path(), 24h, [&] { return ++looks < 3; }), FolderBusy);
  EXPECT_EQ(looks, 3);
}

TEST_F(ReplaceFile, ALockThatIsALinkIsNotFollowed) {
  fs::create_symlink(folder / "elsewhere", folder / ".catgs-lock");
  EXPECT_THROW(lock_for_saving(folder.path()), InputError);
  EXPECT_FALSE(fs::exists(folder / "elsewhere"));
}

}  // namespace
}  // namespace catgs
