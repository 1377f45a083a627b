#include "server/media/media_type.h"

#include <fmt/format.h>

#include "tests/server/media/sample_media.h"
#include "tests/support/test.h"

namespace catgs::test {
namespace {

using namespace std::string_literals;

std::string type_of(std::string_view content) {
  const MediaType* type = media_type_of(content);
  return type ? std::string(type->content_type) : "none";
}

TEST(MediaType, IsThatOfTheContent) {
  EXPECT_EQ(type_of(png_file()), "image/png");
  EXPECT_EQ(type_of(jpeg_file()), "image/jpeg");
  EXPECT_EQ(type_of("RIFF\x10\0\0\0WEBPVP8L"s), "image/webp");
  EXPECT_EQ(type_of("RIFF\x10\0\0\0WAVEfmt "s), "audio/wav");
  EXPECT_EQ(type_of(mp4_file()), "video/mp4");
  EXPECT_EQ(type_of(mp4_file("M4A ")), "audio/mp4");
  EXPECT_EQ(type_of("\x1a\x45\xdf\xa3\x9f\x42\x86\x81\x01\x42\x82\x84webm\x42\x87"s), "video/webm");
  EXPECT_EQ(type_of("ID3\x04\0\0\0\0\0\x23"s), "audio/mpeg");
  EXPECT_EQ(type_of("\xff\xfb\x90\x64"s + std::string(100, '\0')), "audio/mpeg");
  const std::string page = "OggS\0\x02"s + std::string(20, '\0') + "\x01\x13"s;
  EXPECT_EQ(type_of(page + "OpusHead"), "audio/ogg");
  EXPECT_EQ(type_of(page + "\x01vorbis"), "audio/ogg");
  EXPECT_EQ(type_of(vtt_file), "text/vtt; charset=utf-8");
  EXPECT_EQ(type_of("\xef\xbb\xbfWEBVTT - of a guide\n"), "text/vtt; charset=utf-8");
  EXPECT_EQ(type_of("WEBVTT"), "text/vtt; charset=utf-8");
}

TEST(MediaType, IsNoneForWhatMayHoldScriptsOrIsUnknown) {
  for (const std::string& content : {""s,
                                     "\n"s,
                                     "<svg xmlns='http://www.w3.org/2000/svg'>"s,
                                     "<?xml version='1.0'?><svg/>"s,
                                     "<!doctype html>"s,
                                     "%PDF-1.7\n"s,
                                     "GIF89a/*"s,
                                     "GIF87a"s,
                                     "BM"s + std::string(60, '\0'),
                                     "PK\x03\x04"s,
                                     "\x7f\x45LF"s,
                                     "#!/bin/sh\n"s,
                                     "WEBVTTscript"s,
                                     " WEBVTT\n"s,
                                     "alert(1)"s,
                                     "{}"s,
                                     mp4_file("heic"),
                                     mp4_file("avif"),
                                     mp4_file("qt  "),
                                     "\x1a\x45\xdf\xa3\x93\x42\x82\x88matroska"s,
                                     "OggS\0\x02"s + std::string(22, '\0') + "\x80theora"s,
                                     "OggS"s,
                                     "RIFF"s,
                                     "\xff\xd8"s,
                                     "\xff\xfb"s,
                                     "\xff\xff\xff\xff"s + std::string(20, '\xff'),
                                     "ftypisom"s,
                                     "<p>\nftypisom\0\0\0\0isom"s})
    EXPECT_EQ(type_of(content), "none") << content.substr(0, 12);
}

TEST(ImageSize, IsReadFromTheHeaders) {
  const auto size = [](std::string_view content) {
    const auto found = image_size(content);
    return found ? fmt::format("{}x{}", found->width, found->height) : "none";
  };
  EXPECT_EQ(size(png_file(640, 480)), "640x480");
  EXPECT_EQ(size(jpeg_file(640, 480)), "640x480");
  EXPECT_EQ(size("RIFF....WEBPVP8X....\0\0\0\0\x7f\x02\0\xdf\x01\0"s), "640x480");
  EXPECT_EQ(size("RIFF....WEBPVP8L....\x2f\x7f\xc2\x77\0....."s), "640x480");
  EXPECT_EQ(size("RIFF....WEBPVP8 ....\0\0\0\x9d\x01\x2a\x80\x02\xe0\x01"s), "640x480");
  EXPECT_EQ(size(png_file().substr(0, 20)), "none");
  EXPECT_EQ(size(jpeg_file().substr(0, 310)), "none");
  EXPECT_EQ(size("\xff\xd8\xff\xe1\0\0\xff\xe1\0\0\0\0\0"s), "none") << "a segment without end";
  EXPECT_EQ(size("\xff\xd8\xff\xda\0\x08........"s), "none") << "a scan without a frame";
  EXPECT_EQ(size("RIFF....WEBPVP8L....\x2e........."s), "none");
  EXPECT_EQ(size(mp4_file()), "none");
}

bool taken(std::string_view name, std::string_view content) {
  return refused_field([&] { check_media(name, content); }).empty();
}

TEST(CheckMedia, TakesWhatIsWhatItsNameSays) {
  for (const auto& [name, content] : std::vector<std::pair<std::string, std::string>>{
           {"a.png", png_file()},
           {"a.JPG", jpeg_file()},
           {"a.m4a", mp4_file("M4A ")},
           {"a.m4a", mp4_file("isom")},  // browsers play it as a sound, too
           {"a.vtt", std::string(vtt_file)},
           // They are shown as pictures alone: see MediaUpload.
           {"a.jpg", jpeg_file() + "<html><script>alert(1)</script>"}})
    EXPECT_TRUE(taken(name, content)) << name;
  for (const auto& [name, content] :
       std::vector<std::pair<std::string, std::string>>{{"a.png", jpeg_file()},
                                                        {"a.mp4", png_file()},
                                                        {"a.svg", "<svg/>"},
                                                        {"a.html", jpeg_file()},
                                                        {"a.jpg", "<html>"},
                                                        {"a.gif", "GIF89a/*" + jpeg_file()}})
    EXPECT_EQ(refused_field([&] { check_media(name, content); }), name);
  EXPECT_FALSE(taken("../a.jpg", jpeg_file()));
}

TEST(CheckMedia, SaysWhatIsWrong) {
  const auto says = [](const char* text) { return ThrowsMessage<InputError>(HasSubstr(text)); };
  EXPECT_THAT([] { check_media("a.png", jpeg_file()); }, says("its content is image/jpeg"));
  EXPECT_THAT([] { check_media("a.svg", "<svg/>"); }, says("is of no format"));
  for (const auto& [name, brand, words] :
       {std::array{"a.heic", "heic", "is HEIC, which tours cannot show (save it as JPEG)"},
        std::array{"a.jpg", "mif1", "is HEIC"}, std::array{"a.avif", "avif", "is AVIF"},
        std::array{"a.mp4", "qt  ", "is QuickTime, which tours cannot show (save it as MP4)"}})
    EXPECT_THAT([&] { check_media(name, mp4_file(brand)); }, says(words)) << name;
  EXPECT_THAT([] { check_media("a.png", png_file(8193, 1)); }, says("has 8193 x 1 pixels"));
}

TEST(CheckMedia, PicturesAndFilesHaveALargestSize) {
  EXPECT_TRUE(taken("a.png", png_file(8192, 8192)));
  EXPECT_FALSE(taken("a.png", png_file(8193, 1)));
  EXPECT_FALSE(taken("a.png", png_file(1, 0xffffffff)));
  EXPECT_FALSE(taken("a.jpg", jpeg_file(1, 65'535)));
  EXPECT_FALSE(taken("a.jpg", jpeg_file(0, 8))) << "no size";
  EXPECT_FALSE(taken("a.jpg", jpeg_file().substr(0, 200))) << "no size";
  std::string large = mp4_file();
  large.resize(max_media_bytes);
  EXPECT_TRUE(taken("a.mp4", large));
  large += '\0';
  EXPECT_FALSE(taken("a.mp4", large));
}

}  // namespace
}  // namespace catgs::test
