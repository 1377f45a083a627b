#include "server/media/media_type.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "render_core/base/error.h"
#include "tests/server/media/sample_media.h"

namespace catgs::test {
namespace {

using namespace std::string_literals;
using testing::HasSubstr;

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
                                     "\x7f"
                                     "ELF"s,
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

std::string mistake(std::string_view name, std::string_view content) {
  try {
    check_media(name, content);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(CheckMedia, TakesWhatIsWhatItsNameSays) {
  EXPECT_EQ(mistake("a.png", png_file()), "");
  EXPECT_EQ(mistake("a.JPG", jpeg_file()), "");
  EXPECT_EQ(mistake("a.m4a", mp4_file("M4A ")), "");
  EXPECT_EQ(mistake("a.m4a", mp4_file("isom")), "") << "browsers play it as a sound, too";
  EXPECT_EQ(mistake("a.vtt", vtt_file), "");
  EXPECT_THAT(mistake("a.png", jpeg_file()), HasSubstr("its content is image/jpeg"));
  EXPECT_THAT(mistake("a.mp4", png_file()), HasSubstr("give it the extension"));
  EXPECT_THAT(mistake("a.svg", "<svg/>"), HasSubstr("a.svg: is of no format"));
  EXPECT_THAT(mistake("a.html", jpeg_file()), HasSubstr("tours take JPEG"));
  EXPECT_THAT(mistake("a.jpg", "<html>"), HasSubstr("is of no format"));
  EXPECT_THAT(mistake("../a.jpg", jpeg_file()), HasSubstr("no name for it"));
}

/// They are shown as pictures alone: see MediaUpload.
TEST(CheckMedia, TakesAPictureWithSomethingBehindIt) {
  EXPECT_EQ(mistake("a.jpg", jpeg_file() + "<html><script>alert(1)</script>"), "");
  EXPECT_NE(mistake("a.gif", "GIF89a/*" + jpeg_file()), "");
}

TEST(CheckMedia, PicturesAndFilesHaveALargestSize) {
  EXPECT_EQ(mistake("a.png", png_file(8192, 8192)), "");
  EXPECT_THAT(mistake("a.png", png_file(8193, 1)), HasSubstr("has 8193 x 1 pixels"));
  EXPECT_THAT(mistake("a.png", png_file(1, 0xffffffff)), HasSubstr("make it at most 8192"));
  EXPECT_THAT(mistake("a.jpg", jpeg_file(1, 65'535)), HasSubstr("65535"));
  EXPECT_THAT(mistake("a.jpg", jpeg_file(0, 8)), HasSubstr("no size"));
  EXPECT_THAT(mistake("a.jpg", jpeg_file().substr(0, 200)), HasSubstr("no size"));
  std::string large = mp4_file();
  large.resize(max_media_bytes);
  EXPECT_EQ(mistake("a.mp4", large), "");
  large += '\0';
  EXPECT_THAT(mistake("a.mp4", large), HasSubstr("larger than 64 MiB"));
}

}  // namespace
}  // namespace catgs::test
