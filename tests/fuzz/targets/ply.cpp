#include "render_core/scene/formats/ply.h"

#include <algorithm>
#include <sstream>

#include "render_core/scene/formats/compressed_ply.h"
#include "tests/fuzz/target.h"
#include "tests/render_core/scene/formats/encoders.h"
#include "tests/render_core/scene/random_cloud.h"

namespace catgs::fuzz {
namespace {

void parse_plain(Bytes input) {
  const MemorySource file("input", input);
  require_sound(read_ply(file, read_ply_header(file), one_thread()));
}

void parse_compressed(Bytes input) {
  const MemorySource file("input", input);
  const PlyHeader header = read_ply_header(file);
  if (!is_compressed_ply(header)) throw InputError("input", "", "is no compressed .ply");
  require_sound(read_compressed_ply(file, header, one_thread()));
}

/// Two rows of 15 values, each stored as `value`.
std::string two_rows(const std::string& encoding, const std::string& type,
                     const std::string& value) {
  std::string text = "ply\nformat " + encoding + " 1.0\ncomment a\nobj_info b\n";
  text += "element camera 0\nproperty float view\nelement vertex 2\n";
  for (const char* name : {"x", "y", "z", "nx", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0",
                           "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"})
    text += "property " + type + " " + name + "\n";
  text += "element face 0\nproperty list uchar int vertex_indices\nend_header\n";
  for (int k = 0; k < 30; ++k) text += value;
  return text;
}

std::map<std::string, std::string> plain_seeds() {
  std::map<std::string, std::string> seeds;
  for (const int degree : {0, 1, 3}) {
    std::ostringstream out;
    write_ply(test::random_cloud(3, degree), out);
    seeds["degree_" + std::to_string(degree)] = out.str();
  }
  std::ostringstream hard;
  write_ply(cloud_hard_to_sort(), hard);
  seeds["hard_to_sort"] = hard.str();
  seeds["ascii"] = two_rows("ascii", "float", "-0.5e-1 ");
  seeds["big_endian"] = two_rows("binary_big_endian", "double", std::string(8, '\0'));
  std::string lists = two_rows("ascii", "double", "0.5 ");
  lists.insert(lists.find("element vertex"), "element edge 2\nproperty list uchar float at\n");
  seeds["lists_ascii"] = lists.insert(lists.find("end_header\n") + 11, "2 1 1\n0\n");
  lists = two_rows("binary_big_endian", "float", std::string(4, '\0'));
  lists.insert(lists.find("element vertex"), "element edge 2\nproperty list short int at\n");
  seeds["lists"] =
      lists.insert(lists.find("end_header\n") + 11, std::string("\0\1\0\0\0\7\0\0", 8));
  std::string colours = two_rows("binary_little_endian", "uchar", std::string(1, '\1'));
  for (const auto& [from, to] : {std::pair("f_dc_0", "red"),
                                 {"f_dc_1", "green"},
                                 {"f_dc_2", "blue"},
                                 {"rot_0", "scalar_rot_0"},
                                 {"scale_0", "scal_scale_0"}})
    colours.replace(colours.find(from), std::string(from).size(), to);
  std::ranges::replace(colours, '\n', '\r');
  seeds["colours"] = colours;
  seeds["half"] = two_rows("binary_little_endian", "short", std::string(2, '\1'));
  return seeds;
}

std::map<std::string, std::string> compressed_seeds() {
  return {{"plain", test::encode_compressed_ply(test::random_cloud(5, 0), false)},
          {"hard_to_sort", test::encode_compressed_ply(cloud_hard_to_sort(), false)},
          {"colour_limits", test::encode_compressed_ply(test::random_cloud(300, 0), true)},
          {"degree_1", test::encode_compressed_ply(test::random_cloud(5, 1), false)},
          {"degree_2", test::encode_compressed_ply(test::random_cloud(5, 2), true)},
          {"degree_3", test::encode_compressed_ply(test::random_cloud(5, 3), true)}};
}

std::vector<std::string> header_words(std::string_view words) {
  return words_of(std::string(words) +
                  " ply format ascii binary_little_endian binary_big_endian 1.0 char uchar short "
                  "ushort int uint float double int8 uint8 float32 float64 list element vertex "
                  "property comment obj_info face end_header");
}

}  // namespace

std::vector<Target> ply_targets() {
  return {{.name = "ply",
           .parse = parse_plain,
           .seeds = plain_seeds,
           .dictionary = header_words(
               "f_dc_0 f_rest_0 f_rest_44 opacity scale_0 rot_0 nan inf 1e39 4294967296"),
           .change = change_header,
           .max_bytes = 8192},
          {.name = "compressed_ply",
           .parse = parse_compressed,
           .seeds = compressed_seeds,
           .dictionary = header_words("chunk sh packed_position packed_rotation packed_scale "
                                      "packed_color min_x max_scale_z min_r f_rest_0 f_rest_8"),
           .change = change_header,
           .max_bytes = 16384}};
}

}  // namespace catgs::fuzz
