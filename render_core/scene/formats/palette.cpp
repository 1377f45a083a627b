#include "render_core/scene/formats/palette.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <limits>
#include <numeric>
#include <span>
#include <utility>

#include "render_core/base/portable.h"
#include "render_core/scene/formats/calm_range.h"

namespace catgs {

namespace {

constexpr std::size_t ways = 16;  // children of a node
constexpr int codebook_rounds = 60;
constexpr std::size_t cluster_sample = 512;  // vectors that a node's centres are found from
constexpr int cluster_rounds = 3;
constexpr std::size_t block = 8192;

/// Vectors [begin, end) of the order, which get at most `size` entries.
struct Node {
  std::size_t begin, end, size;
};

// Distances are those of whole numbers: they are exact, so that the entries are the same on every
// machine, and a register holds twice as many of them. With at most 48 values of this size, a
// Centres::score() fits into 32 bits.
constexpr float steps = 3800.0f;
constexpr std::size_t max_dims = 48;
constexpr double range_rms = 16.0;          // vectors with values beyond it are wild
constexpr std::size_t extreme_share = 160;  // one of so many values, or vectors, may be extreme
constexpr float widest_gap = 0.25f;         // of the others' range, before an extreme value
constexpr std::size_t wild_entries = 16;    // wild vectors have at most one of so many entries

/// A vector in whole numbers, padded with zeros.
template <std::size_t width>
using Row = std::array<std::int16_t, width>;

template <std::size_t width>
std::int32_t dot(const Row<width>& a, const Row<width>& b) {
  std::int32_t sum = 0;
  for (std::size_t d = 0; d < width; ++d) sum += std::int32_t{a[d]} * std::int32_t{b[d]};
  return sum;
}

using Indices = std::vector<std::uint32_t>;

/// The root mean square of the values of these vectors. Where a few extreme vectors decide it, that
/// of the others. An even sample is enough.
double rms_of(const VectorTable& vectors, const Indices& members) {
  const std::size_t taken = std::min(members.size(), std::size_t{1} << 14);
  std::vector<double> squares(taken);
  for (std::size_t i = 0; i < taken; ++i) {
    const float* vector = vectors[members[i * members.size() / taken]];
    for (std::size_t d = 0; d < vectors.dims; ++d)
      squares[i] += std::pow(static_cast<double>(vector[d]), 2);
  }
  std::ranges::sort(squares);
  const auto mean = [&](std::size_t count) {
    return std::accumulate(squares.begin(), squares.begin() + static_cast<std::ptrdiff_t>(count),
                           0.0) /
           static_cast<double>(count * vectors.dims);
  };
  const double all = mean(taken), calm = mean(taken - taken / extreme_share);
  return std::sqrt(calm > 0.0 && all > 4.0 * calm ? calm : all);
}

template <std::size_t width>
std::vector<Row<width>> rows_of(const VectorTable& vectors, const Indices& members, double rms,
                                ThreadPool& pool) {
  std::vector<Row<width>> rows(members.size());
  const auto scale = static_cast<float>(steps / std::max(range_rms * rms, 1e-20));
  pool.parallel_for((rows.size() + block - 1) / block, [&](std::size_t b) {
    for (std::size_t i = b * block; i < std::min(rows.size(), (b + 1) * block); ++i) {
      const float* vector = vectors[members[i]];
      for (std::size_t d = 0; d < vectors.dims; ++d) {
        const float at = std::clamp(vector[d] * scale, -steps, steps);
        rows[i][d] = static_cast<std::int16_t>(static_cast<int>(at + (steps + 0.5f)) -
                                               static_cast<int>(steps));
      }
    }
  });
  return rows;
}

/// The centres of a node's children.
template <std::size_t width>
class Centres {
 public:
  void add(const Row<width>& centre) { set(count_++, centre); }
  void set(std::size_t k, const Row<width>& centre) {
    rows_[k] = centre;
    squares_[k] = dot(centre, centre);
  }
  [[nodiscard]] std::size_t count() const { return count_; }
  /// The squared distance to centre k, less the square of the vector.
  [[nodiscard]] std::int32_t score(std::size_t k, const Row<width>& row) const {
    return squares_[k] - 2 * dot(row, rows_[k]);
  }
  /// The nearest centre, and its score.
  [[nodiscard]] std::pair<std::size_t, std::int32_t> nearest(const Row<width>& row) const {
    std::size_t best = 0;
    std::int32_t least = std::numeric_limits<std::int32_t>::max();
    for (std::size_t k = 0; k < count_; ++k) {
      const std::int32_t one = score(k, row);
      best = one < least ? k : best;
      least = std::min(one, least);
    }
    return {best, least};
  }

 private:
  std::array<Row<width>, ways> rows_;
  std::array<std::int32_t, ways> squares_;
  std::size_t count_ = 0;
};

template <std::size_t width>
class Tree {
 public:
  /// `members`: the vectors that the tree is of. `rms`: of their values.
  Tree(const VectorTable& vectors, Indices members, double rms, ThreadPool& pool)
      : pool_(pool),
        rows_(rows_of<width>(vectors, members, rms, pool)),
        order_(std::move(members)),
        labels_(order_.size()) {}

  /// The nodes without children, in order.
  std::vector<Node> grow(std::size_t size) {
    std::vector<Node> leaves, level = {{0, order_.size(), size}};
    while (!level.empty()) {
      std::vector<std::vector<Node>> children(level.size());
      pool_.parallel_for(level.size(), [&](std::size_t i) { children[i] = split(level[i]); });
      std::vector<Node> next;
      for (std::size_t i = 0; i < level.size(); ++i) {
        if (children[i].size() < 2)
          leaves.push_back(level[i]);
        else
          next.insert(next.end(), children[i].begin(), children[i].end());
      }
      level = std::move(next);
    }
    return leaves;
  }

  [[nodiscard]] std::span<const std::uint32_t> members(const Node& node) const {
    return std::span(order_).subspan(node.begin, node.end - node.begin);
  }

 private:
  /// An even sample of a node's vectors, by place in the order.
  static std::vector<std::size_t> sample(const Node& node) {
    const std::size_t count = node.end - node.begin, taken = std::min(count, cluster_sample);
    std::vector<std::size_t> some(taken);
    for (std::size_t i = 0; i < taken; ++i) some[i] = node.begin + i * count / taken;
    return some;
  }

  /// k-means++ (Arthur, Vassilvitskii 2007): a vector becomes a centre with a probability by its
  /// squared distance to those before. Fewer than `count` where there are fewer different vectors.
  /// Labels the sample.
  [[nodiscard]] Centres<width> seeds(const std::vector<std::size_t>& some, std::size_t count,
                                     std::uint64_t seed) {
    SplitMix64 random(seed);
    Centres<width> centres;
    std::vector<std::int32_t> scores(some.size(), std::numeric_limits<std::int32_t>::max());
    std::vector<std::int32_t> own(some.size());
    for (std::size_t i = 0; i < some.size(); ++i) own[i] = dot(rows_[some[i]], rows_[some[i]]);
    const auto square = [&](std::size_t i) {
      return static_cast<std::uint64_t>(std::int64_t{own[i]} + scores[i]);
    };
    std::size_t next = random.next() % some.size();
    while (true) {
      const std::size_t k = centres.count();
      centres.add(rows_[some[next]]);
      std::uint64_t sum = 0;
      for (std::size_t i = 0; i < some.size(); ++i) {
        const std::int32_t score = centres.score(k, rows_[some[i]]);
        if (score < scores[i]) {
          scores[i] = score;
          labels_[some[i]] = static_cast<std::uint8_t>(k);
        }
        sum += square(i);
      }
      if (centres.count() == count || sum == 0) return centres;
      std::uint64_t left = random.next() % sum;
      for (next = 0; left >= square(next); ++next) left -= square(next);
    }
  }

  [[nodiscard]] Centres<width> centres_of(const Node& node, std::size_t count) {
    const std::vector<std::size_t> some = sample(node);
    Centres<width> centres = seeds(some, count, node.begin);
    for (int round = 0; round < cluster_rounds; ++round) {
      if (round > 0)
        for (const std::size_t i : some)
          labels_[i] = static_cast<std::uint8_t>(centres.nearest(rows_[i]).first);
      move_to_means(some, centres);
    }
    return centres;
  }

  void move_to_means(const std::vector<std::size_t>& some, Centres<width>& centres) const {
    std::array<std::array<std::int32_t, width>, ways> sums{};
    std::array<std::int32_t, ways> counts{};
    for (const std::size_t i : some) {
      ++counts[labels_[i]];
      for (std::size_t d = 0; d < width; ++d) sums[labels_[i]][d] += rows_[i][d];
    }
    for (std::size_t k = 0; k < centres.count(); ++k) {
      if (counts[k] == 0) continue;
      Row<width> mean;
      for (std::size_t d = 0; d < width; ++d)
        mean[d] = static_cast<std::int16_t>(sums[k][d] / counts[k]);
      centres.set(k, mean);
    }
  }

  using Errors = std::array<std::uint64_t, ways>;

  /// Labels a node's vectors; the sums of squared errors by label.
  Errors label(const Node& node, const Centres<width>& centres) {
    const std::size_t count = node.end - node.begin;
    std::vector<Errors> errors((count + block - 1) / block);
    pool_.parallel_for(errors.size(), [&](std::size_t b) {
      Errors sums{};
      const std::size_t end = std::min(node.end, node.begin + (b + 1) * block);
      for (std::size_t i = node.begin + b * block; i < end; ++i) {
        const auto [k, score] = centres.nearest(rows_[i]);
        labels_[i] = static_cast<std::uint8_t>(k);
        sums[k] += static_cast<std::uint64_t>(std::int64_t{dot(rows_[i], rows_[i])} + score);
      }
      errors[b] = sums;
    });
    Errors total{};
    for (const Errors& sums : errors)
      for (std::size_t k = 0; k < ways; ++k) total[k] += sums[k];
    return total;
  }

  /// Sorts a node's part of the order by label.
  std::vector<Node> partition(const Node& node) {
    std::array<std::size_t, ways> counts{};
    for (std::size_t i = node.begin; i < node.end; ++i) ++counts[labels_[i]];
    std::vector<Node> parts;
    std::array<std::size_t, ways> next{};
    std::size_t begin = node.begin;
    for (std::size_t k = 0; k < ways; ++k) {
      next[k] = begin;
      parts.push_back({begin, begin + counts[k], counts[k] > 0 ? std::size_t{1} : 0});
      begin += counts[k];
    }
    for (std::size_t k = 0; k < ways; ++k)
      while (next[k] < parts[k].end) {
        const std::size_t from = next[k], to = next[labels_[from]]++;
        if (from == to) continue;
        std::swap(rows_[from], rows_[to]);
        std::swap(order_[from], order_[to]);
        std::swap(labels_[from], labels_[to]);
      }
    return parts;
  }

  /// Divides a node's entries: one each, and the rest by squared error.
  static void divide(std::size_t size, const Errors& errors, std::vector<Node>& parts) {
    std::size_t left = size;
    for (const Node& part : parts) left -= part.size;
    const auto room = [&](std::size_t k) {
      return errors[k] > 0 ? parts[k].end - parts[k].begin - parts[k].size : 0;
    };
    const auto weight_of = [&](std::size_t k) { return static_cast<double>(errors[k]); };
    for (bool gave = true; gave && left > 0;) {
      double weight = 0.0;
      for (std::size_t k = 0; k < ways; ++k) weight += room(k) > 0 ? weight_of(k) : 0.0;
      gave = false;
      const auto share = static_cast<double>(left);
      for (std::size_t k = 0; k < ways; ++k) {
        if (room(k) == 0) continue;
        const std::size_t given =
            std::min(room(k), static_cast<std::size_t>(share * weight_of(k) / weight));
        parts[k].size += given;
        left -= given;
        gave |= given > 0;
      }
    }
    for (; left > 0; --left) {  // shares of less than one
      std::size_t most = ways;
      for (std::size_t k = 0; k < ways; ++k)
        if (room(k) > 0 &&
            (most == ways || weight_of(k) / static_cast<double>(parts[k].size) >
                                 weight_of(most) / static_cast<double>(parts[most].size)))
          most = k;
      if (most == ways) return;
      ++parts[most].size;
    }
  }

  /// The children of a node; fewer than two where it is a leaf.
  std::vector<Node> split(const Node& node) {
    const std::size_t count = node.end - node.begin;
    std::vector<Node> parts;
    if (node.size >= count) {
      for (std::size_t i = node.begin; i < node.end; ++i) parts.push_back({i, i + 1, 1});
      return parts;
    }
    if (node.size < 2) return parts;
    const Centres<width> centres = centres_of(node, std::min(ways, node.size));
    const Errors errors = label(node, centres);
    parts = partition(node);
    divide(node.size, errors, parts);
    std::erase_if(parts, [](const Node& part) { return part.begin == part.end; });
    return parts;
  }

  ThreadPool& pool_;
  std::vector<Row<width>> rows_;  // in the order
  Indices order_;
  std::vector<std::uint8_t> labels_;  // by place in the order
};

/// Adds at most `size` entries for these vectors.
template <std::size_t width>
void add_entries(const VectorTable& vectors, Indices of, double rms, std::size_t size,
                 Palette& palette, ThreadPool& pool) {
  Tree<width> tree(vectors, std::move(of), rms, pool);
  const std::vector<Node> leaves = tree.grow(size);
  const std::size_t first = palette.entries.size() / vectors.dims;
  palette.entries.resize((first + leaves.size()) * vectors.dims);
  pool.parallel_for(leaves.size(), [&](std::size_t leaf) {
    std::vector<double> sums(vectors.dims);
    const std::span<const std::uint32_t> members = tree.members(leaves[leaf]);
    for (const std::uint32_t i : members) {
      palette.labels[i] = static_cast<std::uint32_t>(first + leaf);
      for (std::size_t d = 0; d < vectors.dims; ++d) sums[d] += vectors[i][d];
    }
    for (std::size_t d = 0; d < vectors.dims; ++d)
      palette.entries[(first + leaf) * vectors.dims + d] =
          static_cast<float>(sums[d] / static_cast<double>(members.size()));
  });
}

template <std::size_t width>
Palette palette_of(const VectorTable& vectors, std::size_t size, ThreadPool& pool) {
  Indices calm(vectors.count), wild;
  std::iota(calm.begin(), calm.end(), 0u);
  const double rms = rms_of(vectors, calm);
  const auto is_wild = [&](std::uint32_t i) {
    const std::span values(vectors[i], vectors.dims);
    return std::ranges::any_of(values,
                               [&](float v) { return double{std::abs(v)} > range_rms * rms; });
  };
  if (size >= std::min(vectors.count, wild_entries)) {
    std::ranges::copy_if(calm, std::back_inserter(wild), is_wild);
    std::erase_if(calm, is_wild);
  }
  const std::size_t left = size - std::min(size, calm.size());
  const std::size_t spare = std::min(wild.size(), std::max(size / wild_entries, left));
  Palette palette;
  palette.labels.resize(vectors.count);
  add_entries<width>(vectors, std::move(calm), rms, size - spare, palette, pool);
  if (!wild.empty()) {
    const double rms_of_wild = rms_of(vectors, wild);
    add_entries<width>(vectors, std::move(wild), rms_of_wild, spare, palette, pool);
  }
  return palette;
}

}  // namespace

Codebook::Codebook(std::vector<float> values) {
  assert(!values.empty());
  std::sort(values.begin(), values.end());
  // Some values at even steps keep rare ones from being forgotten. Extremes far from all others
  // take none of these.
  const CalmRange calm = calm_range(values.size(), values.size() / extreme_share, widest_gap,
                                    [&](std::size_t i) { return values[i]; });
  const bool some = values[calm.first] < values[calm.last];
  const float low = some ? values[calm.first] : values.front();
  const float high = some ? values[calm.last] : values.back();
  std::vector<float> weighted = values;
  const std::size_t even = values.size() / 8 + 2 * values_.size();
  const float step = (high - low) / static_cast<float>(even);
  for (std::size_t i = 0; i <= even; ++i) weighted.push_back(low + step * static_cast<float>(i));
  std::inplace_merge(weighted.begin(),
                     weighted.begin() + static_cast<std::ptrdiff_t>(values.size()), weighted.end());

  for (std::size_t k = 0; k < values_.size(); ++k) {  // between even shares and even steps
    const float share = weighted[(2 * k + 1) * weighted.size() / (2 * values_.size())];
    const float at = (static_cast<float>(k) + 0.5f) / static_cast<float>(values_.size());
    values_[k] = 0.5f * (share + low + at * (high - low));
  }
  values_.front() = values.front();
  values_.back() = values.back();
  move_to_means(weighted, codebook_rounds);
  move_to_means(values, 1);
  for (std::size_t k = 0; k < middles_.size(); ++k)
    middles_[k] = 0.5f * (values_[k] + values_[k + 1]);
}

void Codebook::move_to_means(const std::vector<float>& sorted, int rounds) {
  std::vector<double> sums(sorted.size() + 1);  // of those before
  for (std::size_t i = 0; i < sorted.size(); ++i) sums[i + 1] = sums[i] + sorted[i];
  for (int round = 0; round < rounds; ++round) {
    std::size_t begin = 0;
    for (std::size_t k = 0; k < values_.size(); ++k) {
      std::size_t end = sorted.size();
      if (k + 1 < values_.size())
        end = static_cast<std::size_t>(
            std::lower_bound(sorted.begin() + static_cast<std::ptrdiff_t>(begin), sorted.end(),
                             0.5f * (values_[k] + values_[k + 1])) -
            sorted.begin());
      if (end > begin)
        values_[k] =
            static_cast<float>((sums[end] - sums[begin]) / static_cast<double>(end - begin));
      begin = end;
    }
  }
}

std::uint8_t Codebook::nearest(float value) const {
  std::size_t at = 0;  // a binary search without branches, which could not be foretold
  for (std::size_t half = 128; half > 0; half /= 2)
    at += static_cast<std::size_t>(middles_[at + half - 1] <= value) * half;
  return static_cast<std::uint8_t>(at);
}

Palette make_palette(const VectorTable& vectors, std::size_t size, ThreadPool& pool) {
  assert(vectors.dims <= max_dims);
  if (vectors.dims <= 16) return palette_of<16>(vectors, size, pool);
  if (vectors.dims <= 24) return palette_of<24>(vectors, size, pool);
  return palette_of<max_dims>(vectors, size, pool);
}

}  // namespace catgs
