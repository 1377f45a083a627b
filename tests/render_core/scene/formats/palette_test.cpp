#include "render_core/scene/formats/palette.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <set>

#include <gtest/gtest.h>

namespace catgs::test {
namespace {

std::vector<float> normal_numbers(std::size_t count, unsigned seed = 1) {
  std::mt19937 random(seed);
  std::normal_distribution<float> normal;
  std::vector<float> numbers(count);
  for (float& v : numbers) v = normal(random);
  return numbers;
}

TEST(CodebookTest, NearestValuesAreFound) {
  const std::vector<float> numbers = normal_numbers(20'000);
  const Codebook book(numbers);
  EXPECT_TRUE(std::is_sorted(book.values().begin(), book.values().end()));
  double squares = 0.0, even = 0.0;
  const auto [low, high] = std::minmax_element(numbers.begin(), numbers.end());
  for (const float v : numbers) {
    float least = 1e9f;
    for (const float value : book.values()) least = std::min(least, std::abs(value - v));
    EXPECT_FLOAT_EQ(std::abs(book.values()[book.nearest(v)] - v), least);
    squares += double{least} * least;
    const float step = (*high - *low) / 255.0f;
    const float error = *low + step * std::round((v - *low) / step) - v;
    even += double{error} * error;
  }
  EXPECT_LT(squares, 0.6 * even);
}

TEST(CodebookTest, FewValuesAreKept) {
  const Codebook book({3.0f, -1.0f, 3.0f, 0.25f});
  for (const float v : {3.0f, -1.0f, 0.25f}) EXPECT_EQ(book.values()[book.nearest(v)], v);
  EXPECT_EQ(Codebook({7.0f}).values()[Codebook({7.0f}).nearest(7.0f)], 7.0f);
}

double error_of(const Codebook& book, const std::vector<float>& numbers) {
  double squares = 0.0;
  for (const float v : numbers) squares += std::pow(book.values()[book.nearest(v)] - v, 2);
  return squares;
}

TEST(CodebookTest, ExtremeValuesCostTheOthersNothing) {
  for (const std::size_t count : {256u, 20'000u}) {
    const std::vector<float> numbers = normal_numbers(count);
    std::vector<float> with = numbers;
    with.insert(with.end(), {-1000.0f, 300.0f});
    const Codebook without_extremes(numbers), book(with);
    EXPECT_LT(error_of(book, numbers), 1.1 * error_of(without_extremes, numbers) + 1e-4);
    for (const float v : {-1000.0f, 300.0f}) EXPECT_EQ(book.values()[book.nearest(v)], v);
  }
}

double error_of(const VectorTable& vectors, const Palette& palette) {
  double squares = 0.0;
  for (std::size_t i = 0; i < vectors.count; ++i)
    for (std::size_t d = 0; d < vectors.dims; ++d) {
      const double error = palette.entries[palette.labels[i] * vectors.dims + d] - vectors[i][d];
      squares += error * error;
    }
  return squares;
}

TEST(PaletteTest, GroupsAreFound) {
  constexpr std::size_t dims = 9, groups = 300, count = 30'000;
  const std::vector<float> centres = normal_numbers(groups * dims),
                           noise = normal_numbers(count * dims, 2);
  std::vector<float> numbers(count * (dims + 3), 100.0f);  // rows with something else in them
  double variance = 0.0;
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t d = 0; d < dims; ++d) {
      numbers[i * (dims + 3) + d] =
          centres[i * 7919 % groups * dims + d] + 0.01f * noise[i * dims + d];
      variance += std::pow(0.01 * noise[i * dims + d], 2);
    }
  const VectorTable vectors{numbers.data(), count, dims + 3, dims};
  ThreadPool pool(2);
  const Palette palette = make_palette(vectors, 1024, pool);
  EXPECT_LE(palette.entries.size(), 1024 * dims);
  EXPECT_LT(error_of(vectors, palette), 1.5 * variance);
}

TEST(PaletteTest, PalettesAreTheSameForAnyNumberOfThreads) {
  const std::vector<float> numbers = normal_numbers(40'000 * 9);
  const VectorTable vectors{numbers.data(), 40'000, 9, 9};
  ThreadPool one(1), four(4);
  const Palette a = make_palette(vectors, 3000, one), b = make_palette(vectors, 3000, four);
  EXPECT_EQ(a.entries, b.entries);
  EXPECT_EQ(a.labels, b.labels);
  EXPECT_EQ(std::set<std::uint32_t>(a.labels.begin(), a.labels.end()).size(), a.entries.size() / 9);
  EXPECT_GT(a.entries.size() / 9, 2900u) << "entries are used";
}

TEST(PaletteTest, ExtremeVectorsCostTheOthersNothing) {
  constexpr std::size_t dims = 9, count = 30'000;
  std::vector<float> numbers = normal_numbers(count * dims);
  const VectorTable calm{numbers.data(), count, dims, dims};
  ThreadPool pool(2);
  const double before = error_of(calm, make_palette(calm, 1024, pool));
  for (std::size_t d = 0; d < dims; ++d) numbers[d] = d % 2 ? 3e5f : -1e5f;
  const Palette palette = make_palette(calm, 1024, pool);
  EXPECT_LE(palette.entries.size(), 1024 * dims);
  EXPECT_LT(error_of(calm, palette), 1.1 * before);
}

TEST(PaletteTest, EachVectorHasAnEntryWhileThereAreEnough) {
  const std::vector<float> numbers = normal_numbers(100 * 24);
  const VectorTable vectors{numbers.data(), 100, 24, 24};
  ThreadPool pool(2);
  const Palette palette = make_palette(vectors, 100, pool);
  EXPECT_EQ(error_of(vectors, palette), 0.0);
}

TEST(PaletteTest, EqualVectorsAreOneEntry) {
  const std::vector<float> numbers(5000 * 9, 0.5f);
  ThreadPool pool(2);
  const Palette palette = make_palette({numbers.data(), 5000, 9, 9}, 64, pool);
  EXPECT_EQ(palette.entries, std::vector<float>(9, 0.5f));
}

}  // namespace
}  // namespace catgs::test
