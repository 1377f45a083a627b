#include "server/media/media_folder.h"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include "tests/server/media/sample_media.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test.h"

namespace catgs::test {
namespace {

namespace fs = std::filesystem;

class MediaFolderTest : public testing::Test {
 protected:
  std::string mistake(const std::string& name, std::string_view content) {
    try {
      media_.save(name, content);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }
  std::vector<std::string> names() {
    std::vector<std::string> names;
    for (const MediaFile& file : media_.list()) names.push_back(file.name);
    return names;
  }

  const TemporaryFolder folder_;
  const MediaFolder media_{folder_ / "hall.json"};
};

TEST_F(MediaFolderTest, KeepsWhatIsSavedBesideTheScene) {
  EXPECT_FALSE(media_.find("door.jpg"));
  EXPECT_THAT(names(), ElementsAre());
  media_.save("door.jpg", jpeg_file());
  media_.save("b.vtt", vtt_file);
  const auto file = media_.find("door.jpg");
  ASSERT_TRUE(file);
  EXPECT_EQ(file->type->content_type, "image/jpeg");
  EXPECT_EQ(file->bytes, jpeg_file().size());
  EXPECT_TRUE(fs::is_regular_file(folder_ / "hall.media" / "door.jpg"));
  EXPECT_EQ(media_.read("door.jpg", file->etag, 0, 1000), jpeg_file());
  EXPECT_EQ(media_.read("door.jpg", file->etag, 2, 2), "\xff\xe1");
  EXPECT_THAT(names(), ElementsAre("b.vtt", "door.jpg"));

  media_.save("door.jpg", jpeg_file(10, 10) + "more");
  const auto later = media_.find("door.jpg");
  EXPECT_NE(later->etag, file->etag);
  EXPECT_EQ(media_.read("door.jpg", file->etag, 0, 1000), "") << "another file by now";
  EXPECT_THAT(names(), ElementsAre("b.vtt", "door.jpg")) << "and none before it";
}

TEST_F(MediaFolderTest, HoldsRegularFilesOfKnownFormatsAlone) {
  folder_.write("hall.media/good.png", png_file());
  folder_.write("hall.media/page.png", "<!doctype html>");
  folder_.write("hall.media/.hidden.png", png_file());
  folder_.write("hall.media/inner/a.png", png_file());
  folder_.write("secret.png", png_file());
  fs::create_symlink(folder_ / "secret.png", folder_ / "hall.media/link.png");
  ASSERT_EQ(::mkfifo((folder_ / "hall.media/pipe.png").c_str(), 0600), 0);
  EXPECT_THAT(names(), ElementsAre("good.png"));
  for (const char* name : {"page.png", ".hidden.png", "inner", "inner/a.png", "../secret.png",
                           "link.png", "pipe.png", "", ".", ".."}) {
    EXPECT_FALSE(media_.find(name)) << name;
    EXPECT_EQ(media_.read(name, "", 0, 10), "") << name;
  }
}

TEST_F(MediaFolderTest, ReplacesALinkAndNotWhatItLeadsTo) {
  folder_.write("secret.png", png_file());
  fs::create_directory(folder_ / "hall.media");
  fs::create_symlink(folder_ / "secret.png", folder_ / "hall.media/a.png");
  media_.save("a.png", png_file(9, 9));
  EXPECT_FALSE(fs::is_symlink(folder_ / "hall.media/a.png"));
  EXPECT_EQ(fs::file_size(folder_ / "secret.png"), png_file().size());
  EXPECT_EQ(media_.find("a.png")->bytes, png_file().size());
}

TEST_F(MediaFolderTest, OneOfTwoServersReplacesAFileThatBothHaveSeen) {
  media_.save("a.png", png_file());
  for (int round = 0; round < 50; ++round) {
    const std::string seen = media_.find("a.png")->etag;
    std::array<std::string, 2> contents;
    std::array<bool, 2> saved{};
    std::vector<std::thread> servers;
    for (std::size_t i = 0; i < 2; ++i)
      servers.emplace_back([&, i] {
        contents[i] = png_file() + fmt::format("{} {}", round, i);
        const MediaFolder own(folder_ / "hall.json");
        try {
          saved[i] = own.save("a.png", contents[i], [&](const auto& etag) { return etag == seen; });
        } catch (const InputError&) {  // it saves nothing
        }
      });
    for (std::thread& server : servers) server.join();
    ASSERT_NE(saved[0], saved[1]) << round;
    const auto file = media_.find("a.png");
    ASSERT_EQ(media_.read("a.png", file->etag, 0, 1000), contents[saved[0] ? 0 : 1]) << round;
  }
  EXPECT_THAT(names(), ElementsAre("a.png"));
}

/// The operator makes the folder where the server may not write beside the scene.
TEST_F(MediaFolderTest, NeedsNothingFromTheScenesFolderButItself) {
  fs::create_directories(folder_ / "hall.media");
  fs::create_directory(folder_ / ".catgs-lock");  // root may write everywhere, but no lock there
  EXPECT_EQ(mistake("a.png", png_file()), "");
  EXPECT_THAT(names(), ElementsAre("a.png"));
}

TEST_F(MediaFolderTest, RefusesWhatIsNotWhatItSaysBeforeItMakesAFolder) {
  EXPECT_NE(mistake("a.png", "<svg/>"), "");
  EXPECT_NE(mistake("../a.png", png_file()), "");
  EXPECT_FALSE(fs::exists(folder_ / "hall.media"));
}

TEST_F(MediaFolderTest, HasRoomForSoManyFilesAndBytes) {
  for (std::size_t i = 0; i < max_media_files; ++i)
    folder_.write(fmt::format("hall.media/{}.png", i), png_file());
  EXPECT_THAT(mistake("one_more.png", png_file()), HasSubstr("hall.media: is full: 256 files"));
  EXPECT_EQ(mistake("7.png", png_file(9, 9)), "") << "in place of another";
  EXPECT_EQ(names().size(), max_media_files);
  fs::remove(folder_ / "hall.media/0.png");
  EXPECT_EQ(mistake("one_more.png", png_file()), "");
  fs::resize_file(folder_ / "hall.media/1.png", max_media_folder_bytes - 100);
  EXPECT_NE(mistake("2.png", png_file() + std::string(200, 'x')), "");
}

TEST_F(MediaFolderTest, SaysWhereNothingCanBeWritten) {
  folder_.write("hall.media", "a file has its name");
  EXPECT_THAT(mistake("a.png", png_file()),
              AllOf(HasSubstr("hall.media"), Not(HasSubstr(folder_.path().string()))));
  fs::remove(folder_ / "hall.media");
  fs::create_directories(folder_ / "hall.media/a.png/inner");
  EXPECT_THAT(mistake("a.png", png_file()),
              AllOf(HasSubstr("a.png: "), Not(HasSubstr(folder_.path().string()))));
  EXPECT_EQ(mistake("b.png", png_file()), "");
}

}  // namespace
}  // namespace catgs::test
