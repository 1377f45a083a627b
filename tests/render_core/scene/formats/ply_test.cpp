#include "render_core/scene/formats/ply.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <vector>

#include <fmt/format.h>

#include "render_core/scene/activations.h"
#include "tests/render_core/scene/scene_test_support.h"

namespace catgs::test {
namespace {

using ::testing::StartsWith;

GaussianCloud parse(const std::string& bytes) {
  const MemorySource file("scene.ply", bytes_of(bytes));
  return read_ply(file, read_ply_header(file), two_threads());
}

void expect_same_up_to_activations(const GaussianCloud& a, const GaussianCloud& b) {
  ASSERT_EQ(a.size(), b.size());
  ASSERT_EQ(a.sh_degree, b.sh_degree);
  EXPECT_EQ(a.mean, b.mean);
  EXPECT_EQ(a.sh, b.sh);
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a.rotation[i], b.rotation[i]);
    EXPECT_NEAR(a.opacity[i], b.opacity[i], 1e-7f + 1e-7f * a.opacity[i]);
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(a.scale[i][k], b.scale[i][k], 1e-6f * a.scale[i][k]);
  }
}

TEST(Ply, WrittenCloudsReadBackTheSame) {
  for (const int degree : {0, 1, 2, 3}) {
    const GaussianCloud cloud = random_cloud(3000, degree);
    expect_same_up_to_activations(cloud, parse(ply_bytes(cloud)));
  }
}

TEST(Ply, CommentsTellTheModel) {
  const std::string bytes = ply_bytes(random_cloud(10, 0));
  const auto model_with = [&](const std::string& comment) {
    std::string commented = bytes;
    return parse(commented.insert(commented.find("element"), comment + "\n")).model;
  };
  EXPECT_EQ(parse(bytes).model, SplatModel::standard);
  EXPECT_EQ(model_with("comment SplatRenderMode: mip"), SplatModel::antialiased);
  EXPECT_EQ(model_with("comment SplatRenderMode: 2dgs"), SplatModel::surfels);
  EXPECT_EQ(model_with("comment SplatRenderMode: default"), SplatModel::standard);
  EXPECT_EQ(model_with("comment antialiased 1"), SplatModel::antialiased);
  EXPECT_EQ(model_with("comment antialiased 0"), SplatModel::standard);
  for (const char* other : {"comment SplatRenderMode: tomorrow", "comment antialiased yes",
                            "comment antialiased", "comment SplatRenderMode: mip or not"})
    EXPECT_EQ(model_with(other), SplatModel::standard) << other;
}

TEST(Ply, EachModelIsWrittenAndReadAgain) {
  GaussianCloud cloud = random_cloud(10, 1);
  for (const SplatModel model :
       {SplatModel::standard, SplatModel::antialiased, SplatModel::surfels}) {
    cloud.model = model;
    EXPECT_EQ(parse(ply_bytes(cloud)).model, model);
  }
}

/// A test-side encoder: any order, types and encoding.
struct Column {
  std::string name;
  std::string type;
  std::vector<double> values;
};

std::vector<Column> columns_of(const GaussianCloud& cloud) {
  std::vector<Column> columns;
  const auto add = [&](const std::string& name, auto value_of) {
    Column column{name, "float", {}};
    for (std::size_t i = 0; i < cloud.size(); ++i) column.values.push_back(value_of(i));
    columns.push_back(std::move(column));
  };
  const int rest = cloud.sh_count() - 1;
  for (int k = 0; k < 3; ++k) {
    add(std::string(1, "xyz"[k]), [&](std::size_t i) { return cloud.mean[i][k]; });
    add("f_dc_" + std::to_string(k), [&](std::size_t i) { return cloud.sh_of(i)[0][k]; });
    add("scale_" + std::to_string(k), [&](std::size_t i) { return std::log(cloud.scale[i][k]); });
  }
  for (int k = 0; k < 3 * rest; ++k)
    add("f_rest_" + std::to_string(k),
        [&](std::size_t i) { return cloud.sh_of(i)[1 + k % rest][k / rest]; });
  for (int k = 0; k < 4; ++k)
    add("rot_" + std::to_string(k), [&](std::size_t i) {
      const glm::quat& q = cloud.rotation[i];
      return std::array{q.w, q.x, q.y, q.z}[static_cast<std::size_t>(k)];
    });
  add("opacity", [&](std::size_t i) { return logit(cloud.opacity[i]); });
  return columns;
}

template <class T>
void append_number(std::string& out, double value, bool big_endian) {
  auto bytes = std::bit_cast<std::array<char, sizeof(T)>>(static_cast<T>(value));
  if (big_endian) std::reverse(bytes.begin(), bytes.end());
  out.append(bytes.data(), bytes.size());
}

std::string encode(const std::vector<Column>& columns, const std::string& encoding) {
  const std::size_t rows = columns.front().values.size();
  std::string out = "ply\r\nformat " + encoding +
                    " 1.0\r\ncomment made by a test\nelement vertex " + std::to_string(rows) + "\n";
  for (const Column& c : columns) out += "property " + c.type + " " + c.name + "\n";
  out += "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
  for (std::size_t i = 0; i < rows; ++i)
    for (const Column& c : columns) {
      if (encoding == "ascii") {
        std::ostringstream text;
        text.precision(17);
        text << c.values[i] << (&c == &columns.back() ? "\r\n" : "  ");
        out += text.str();
      } else if (c.type == "double") {
        append_number<double>(out, c.values[i], encoding == "binary_big_endian");
      } else if (c.type == "uchar") {
        append_number<unsigned char>(out, c.values[i], encoding == "binary_big_endian");
      } else if (c.type == "int16") {
        append_number<std::int16_t>(out, c.values[i], encoding == "binary_big_endian");
      } else {
        append_number<float>(out, c.values[i], encoding == "binary_big_endian");
      }
    }
  return out + (encoding == "ascii" ? "3 0 1 2\n" : std::string(13, '\0'));
}

TEST(Ply, SurfelsHaveTwoScales) {
  const GaussianCloud cloud = random_cloud(100, 0);
  std::vector<Column> columns = columns_of(cloud);
  std::erase_if(columns, [](const Column& column) { return column.name == "scale_2"; });
  const GaussianCloud read = parse(encode(columns, "binary_little_endian"));
  EXPECT_EQ(read.model, SplatModel::surfels);
  ASSERT_EQ(read.size(), cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i)
    EXPECT_NEAR(read.scale[i].y, cloud.scale[i].y, 1e-5f * cloud.scale[i].y);
  // Whatever the model that a flag puts in its place.
  for (const glm::vec3& scale : read.scale) EXPECT_LT(scale.z, 0.002f * scale.x);
}

TEST(Ply, AnyOrderTypesAndExtraPropertiesAreRead) {
  const GaussianCloud cloud = random_cloud(700, 3);
  std::vector<Column> columns = columns_of(cloud);
  for (std::size_t c = 0; c < columns.size(); c += 3) columns[c].type = "double";
  columns.push_back({"nx", "float", std::vector<double>(cloud.size(), 0.0)});
  columns.push_back({"segment", "uchar", std::vector<double>(cloud.size(), 200.0)});
  columns.push_back({"label", "int16", std::vector<double>(cloud.size(), -7.0)});
  std::shuffle(columns.begin(), columns.end(), std::mt19937(5));
  for (const char* encoding : {"binary_little_endian", "binary_big_endian", "ascii"})
    expect_same_up_to_activations(cloud, parse(encode(columns, encoding)));
}

TEST(Ply, IntegerPropertiesAreConverted) {
  std::vector<Column> columns = columns_of(random_cloud(2, 0));
  for (Column& c : columns)
    if (c.name == "x") c = {"x", "int16", {-3.0, 500.0}};
  for (const char* encoding : {"binary_little_endian", "binary_big_endian"}) {
    const GaussianCloud read = parse(encode(columns, encoding));
    EXPECT_EQ(read.mean[0].x, -3.0f);
    EXPECT_EQ(read.mean[1].x, 500.0f);
  }
}

TEST(Ply, ElementsBeforeVertexAreSkipped) {
  const GaussianCloud cloud = random_cloud(10, 0);
  std::string bytes = ply_bytes(cloud);
  bytes.insert(bytes.find("element vertex"), "element camera 2\nproperty double f\n");
  bytes.insert(bytes.find("end_header\n") + 11, std::string(16, 'c'));
  EXPECT_EQ(parse(bytes).mean, cloud.mean);
}

TEST(Ply, ShOfDegreeFourIsCutToThree) {
  const GaussianCloud cloud = random_cloud(5, 3);
  std::vector<Column> columns = columns_of(cloud);
  std::erase_if(columns, [](const Column& c) { return c.name.starts_with("f_rest_"); });
  for (int channel = 0; channel < 3; ++channel)
    for (int k = 0; k < 24; ++k) {
      Column column{"f_rest_" + std::to_string(channel * 24 + k), "float", {}};
      for (std::size_t i = 0; i < cloud.size(); ++i)
        column.values.push_back(k < 15 ? cloud.sh_of(i)[1 + k][channel] : 9.0f);
      columns.push_back(column);
    }
  expect_same_up_to_activations(cloud, parse(encode(columns, "binary_little_endian")));
}

TEST(Ply, ErrorsNameTheHeaderLine) {
  const std::string format = "ply\nformat ascii 1.0\n";
  struct Header {
    std::string text;
    int line;
  };
  for (const Header& header : std::vector<Header>{
           {"plx\n", 1},
           {"ply\nformat ascii 2.0\n", 2},
           {format + "element vertex -1\n", 3},
           {format + "property float x\n", 3},
           {format + "element vertex 1\nproperty quad x\nend_header\n", 4},
           {format + "element vertex 1\n", 4},
           {"ply\nend_header\n", 2},
           {format + "element a 1\nelement a 1\n", 4},
           {format + "element a 1\nproperty list uchar quad a\nend_header\n", 4},
       })
    EXPECT_EQ(refusal_of([&] { parse(header.text); }),
              (Refusal{"scene.ply", fmt::format("header line {}", header.line)}))
        << header.text;
  EXPECT_EQ(input_error([&] { parse(format + "element vertex -1\n"); }),
            "scene.ply: header line 3: '-1' is not a count");
  const auto with_header_of = [](std::size_t bytes) {
    std::string ply = ply_bytes(random_cloud(3, 0));
    const std::size_t more = bytes - (ply.find("end_header\n") + 11);
    return ply.insert(4, "comment " + std::string(more - 9, 'x') + "\n");
  };
  EXPECT_NO_THROW(parse(with_header_of(65'536)));
  EXPECT_THAT(refusal_of([&] { parse(with_header_of(65'537)); }).where, StartsWith("header line "));
}

TEST(Ply, ErrorsNameTheElementOrProperty) {
  const auto with = [](const std::string& before, const std::string& line) {
    std::string bytes = ply_bytes(random_cloud(3, 1));
    return bytes.insert(bytes.find(before), line);
  };
  const auto renamed = [](const std::string& from, const std::string& to) {
    std::string bytes = ply_bytes(random_cloud(3, 1));
    return bytes.replace(bytes.find(from), from.size(), to);
  };
  const std::string list = "property list uchar int indices\n";
  struct File {
    std::string bytes;
    const char* where;
  };
  for (const File& file : std::vector<File>{
           {renamed("opacity", "opaaity"), "property opacity"},
           {renamed("f_rest_8", "f_xxxx_8"), "property f_rest_*"},
           {"ply\nformat ascii 1.0\nelement face 1\nproperty int a\nend_header\n1\n", "header"},
           {with("end_header", list), "element vertex"},
           {with("element vertex", "element face 1\n" + list), "element vertex"},
           {renamed("vertex 3", "vertex 0"), "element vertex"},
       })
    EXPECT_EQ(refusal_of([&] { parse(file.bytes); }), (Refusal{"scene.ply", file.where}));
  EXPECT_EQ(parse(with("end_header", "element face 0\n" + list)).size(), 3u);
}

TEST(Ply, CutOffFilesAreRefusedAtEveryLength) {
  const std::string bytes = ply_bytes(random_cloud(4, 1));
  for (std::size_t length = 0; length < bytes.size(); ++length)
    EXPECT_EQ(refusal_of([&] { parse(bytes.substr(0, length)); }).source, "scene.ply")
        << "cut at byte " << length;
}

TEST(Ply, LyingCountsAreRefusedBeforeMemoryIsTaken) {
  const std::string bytes = ply_bytes(random_cloud(4, 0));
  for (const char* count : {"5", "200000000", "18446744073709551615"}) {
    std::string lie = bytes;
    lie.replace(lie.find("vertex 4"), 8, std::string("vertex ") + count);
    refusal_of([&] { parse(lie); });
    std::string ascii_lie = lie;
    ascii_lie.replace(ascii_lie.find("binary_little_endian"), 20, "ascii");
    refusal_of([&] { parse(ascii_lie); });
  }
}

TEST(Ply, AsciiErrorsNameTheByte) {
  const std::string text = encode(columns_of(random_cloud(3, 0)), "ascii");
  std::string garbage = text;
  const std::size_t at = garbage.find("end_header\n") + 11;
  garbage[at] = '?';
  EXPECT_EQ(refusal_of([&] { parse(garbage); }),
            (Refusal{"scene.ply", fmt::format("byte {}", at)}));
}

}  // namespace
}  // namespace catgs::test
