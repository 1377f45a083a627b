#include "render_core/scene/formats/palette.h"

#include <algorithm>
#include <cassert>
#include <limits>
#include <numeric>
#include <span>
#include <utility>

#include "render_core/base/portable.h"

namespace catgs {

namespace {

constexpr std::size_t ways = 16;  // children of a node
constexpr std::size_t codebook_sample = std::size_t{1} << 20;
constexpr int codebook_rounds = 60;
constexpr std::size_t cluster_sample = 2048;  // vectors that a node's centres are found from
constexpr int cluster_rounds = 4;
constexpr std::size_t block = 8192;

/// Vectors [begin, end) of the order, which get at most `size` entries.
struct Node {
  std::size_t begin, end, size;
};

/// The centres of a node's children. Those of one dimension are neighbours, so that a vector is
/// compared with all of them at once.
class Centres {
 public:
  explicit Centres(std::size_t dims) : dims_(dims), columns_(dims * ways, nowhere) {}

  void set(std::size_t k, const float* centre) {
    for (std::size_t d = 0; d < dims_; ++d) columns_[d * ways + k] = centre[d];
  }
  /// The nearest centre, and the squared distance to it.
  [[nodiscard]] std::pair<std::size_t, float> nearest(const float* vector) const {
    std::array<float, ways> squares{};
    for (std::size_t d = 0; d < dims_; ++d) {
      const float* column = &columns_[d * ways];
      for (std::size_t k = 0; k < ways; ++k) {
        const float difference = vector[d] - column[k];
        squares[k] += difference * difference;
      }
    }
    const auto least = std::min_element(squares.begin(), squares.end());
    return {static_cast<std::size_t>(least - squares.begin()), *least};
  }

 private:
  static constexpr float nowhere = 1e17f;  // farther than any vector, and its square is finite
  std::size_t dims_;
  std::vector<float> columns_;
};

class Tree {
 public:
  Tree(const VectorTable& vectors, ThreadPool& pool)
      : vectors_(vectors),
        pool_(pool),
        order_(vectors.count),
        scratch_(vectors.count),
        labels_(vectors.count) {
    std::iota(order_.begin(), order_.end(), 0u);
  }

  /// The nodes without children, in order.
  std::vector<Node> grow(std::size_t size) {
    std::vector<Node> leaves, level = {{0, vectors_.count, size}};
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
  [[nodiscard]] const float* vector(std::size_t place) const { return vectors_[order_[place]]; }

  /// An even sample of a node's vectors.
  [[nodiscard]] std::vector<const float*> sample(const Node& node) const {
    const std::size_t count = node.end - node.begin, taken = std::min(count, cluster_sample);
    std::vector<const float*> some(taken);
    for (std::size_t i = 0; i < taken; ++i) some[i] = vector(node.begin + i * count / taken);
    return some;
  }

  /// k-means++ (Arthur, Vassilvitskii 2007): a vector becomes a centre with a probability by its
  /// squared distance to those before. Fewer than `count` where there are fewer different vectors.
  [[nodiscard]] std::vector<const float*> seeds(const std::vector<const float*>& some,
                                                std::size_t count, std::uint64_t seed) const {
    SplitMix64 random(seed);
    std::vector<const float*> chosen = {some[random.next() % some.size()]};
    std::vector<float> squares(some.size(), std::numeric_limits<float>::max());
    while (chosen.size() < count) {
      double sum = 0.0;
      for (std::size_t i = 0; i < some.size(); ++i) {
        float square = 0.0f;
        for (std::size_t d = 0; d < vectors_.dims; ++d) {
          const float difference = some[i][d] - chosen.back()[d];
          square += difference * difference;
        }
        squares[i] = std::min(squares[i], square);
        sum += squares[i];
      }
      if (!(sum > 0.0)) break;
      double left = sum * static_cast<double>(random.next() >> 11) * 0x1p-53;
      std::size_t next = 0;
      for (std::size_t i = 0; i < some.size() && left >= 0.0; ++i) {
        if (squares[i] > 0.0f) next = i;
        left -= squares[i];
      }
      chosen.push_back(some[next]);
    }
    return chosen;
  }

  [[nodiscard]] Centres centres_of(const Node& node, std::size_t count) const {
    const std::vector<const float*> some = sample(node);
    const std::vector<const float*> first = seeds(some, count, node.begin);
    const std::size_t dims = vectors_.dims;
    Centres centres(dims);
    for (std::size_t k = 0; k < first.size(); ++k) centres.set(k, first[k]);
    std::vector<float> sums(ways * dims);
    for (int round = 0; round < cluster_rounds; ++round) {
      std::fill(sums.begin(), sums.end(), 0.0f);
      std::array<std::size_t, ways> counts{};
      for (const float* one : some) {
        const std::size_t k = centres.nearest(one).first;
        ++counts[k];
        for (std::size_t d = 0; d < dims; ++d) sums[k * dims + d] += one[d];
      }
      for (std::size_t k = 0; k < ways; ++k) {
        if (counts[k] == 0) continue;
        for (std::size_t d = 0; d < dims; ++d) sums[k * dims + d] /= static_cast<float>(counts[k]);
        centres.set(k, &sums[k * dims]);
      }
    }
    return centres;
  }

  using Errors = std::array<double, ways>;

  /// Labels a node's vectors; the sums of squared errors by label.
  Errors label(const Node& node, const Centres& centres) {
    const std::size_t count = node.end - node.begin;
    std::vector<Errors> errors((count + block - 1) / block);
    pool_.parallel_for(errors.size(), [&](std::size_t b) {
      Errors sums{};
      const std::size_t end = std::min(node.end, node.begin + (b + 1) * block);
      for (std::size_t i = node.begin + b * block; i < end; ++i) {
        const auto [k, square] = centres.nearest(vector(i));
        labels_[i] = static_cast<std::uint8_t>(k);
        sums[k] += square;
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
    for (std::size_t i = node.begin; i < node.end; ++i) scratch_[next[labels_[i]]++] = order_[i];
    std::copy(scratch_.begin() + static_cast<std::ptrdiff_t>(node.begin),
              scratch_.begin() + static_cast<std::ptrdiff_t>(node.end),
              order_.begin() + static_cast<std::ptrdiff_t>(node.begin));
    return parts;
  }

  /// Divides a node's entries: one each, and the rest by squared error.
  static void divide(std::size_t size, const Errors& errors, std::vector<Node>& parts) {
    std::size_t left = size;
    for (const Node& part : parts) left -= part.size;
    const auto room = [&](std::size_t k) {
      return errors[k] > 0.0 ? parts[k].end - parts[k].begin - parts[k].size : 0;
    };
    for (bool gave = true; gave && left > 0;) {
      double weight = 0.0;
      for (std::size_t k = 0; k < ways; ++k) weight += room(k) > 0 ? errors[k] : 0.0;
      gave = false;
      const auto share = static_cast<double>(left);
      for (std::size_t k = 0; k < ways; ++k) {
        if (room(k) == 0) continue;
        const std::size_t given =
            std::min(room(k), static_cast<std::size_t>(share * errors[k] / weight));
        parts[k].size += given;
        left -= given;
        gave |= given > 0;
      }
    }
    for (; left > 0; --left) {  // shares of less than one
      std::size_t most = ways;
      for (std::size_t k = 0; k < ways; ++k)
        if (room(k) > 0 &&
            (most == ways || errors[k] / static_cast<double>(parts[k].size) >
                                 errors[most] / static_cast<double>(parts[most].size)))
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
    const Centres centres = centres_of(node, std::min(ways, node.size));
    const Errors errors = label(node, centres);
    parts = partition(node);
    divide(node.size, errors, parts);
    std::erase_if(parts, [](const Node& part) { return part.begin == part.end; });
    return parts;
  }

  const VectorTable& vectors_;
  ThreadPool& pool_;
  std::vector<std::uint32_t> order_, scratch_;
  std::vector<std::uint8_t> labels_;  // by place in the order
};

}  // namespace

Codebook::Codebook(std::vector<float> values) {
  assert(!values.empty());
  if (values.size() > codebook_sample) {
    const std::size_t count = values.size();
    for (std::size_t i = 0; i < codebook_sample; ++i)
      values[i] = values[i * count / codebook_sample];
    values.resize(codebook_sample);
  }
  std::sort(values.begin(), values.end());
  // Some values at even steps keep rare ones from being forgotten.
  std::vector<float> weighted = values;
  const std::size_t even = values.size() / 8 + 2 * values_.size();
  const float step = (values.back() - values.front()) / static_cast<float>(even);
  for (std::size_t i = 0; i <= even; ++i)
    weighted.push_back(values.front() + step * static_cast<float>(i));
  std::sort(weighted.begin(), weighted.end());

  for (std::size_t k = 0; k < values_.size(); ++k) {  // between even shares and even steps
    const float share = weighted[(2 * k + 1) * weighted.size() / (2 * values_.size())];
    const float at = (static_cast<float>(k) + 0.5f) / static_cast<float>(values_.size());
    values_[k] = 0.5f * (share + values.front() + at * (values.back() - values.front()));
  }
  for (int round = 0; round < codebook_rounds; ++round) move_to_means(weighted);
  move_to_means(values);
  for (std::size_t k = 0; k < middles_.size(); ++k)
    middles_[k] = 0.5f * (values_[k] + values_[k + 1]);
}

void Codebook::move_to_means(const std::vector<float>& sorted) {
  auto begin = sorted.begin();
  for (std::size_t k = 0; k < values_.size(); ++k) {
    auto end = sorted.end();
    if (k + 1 < values_.size())
      end = std::lower_bound(begin, end, 0.5f * (values_[k] + values_[k + 1]));
    if (end > begin)
      values_[k] =
          static_cast<float>(std::accumulate(begin, end, 0.0) / static_cast<double>(end - begin));
    begin = end;
  }
}

std::uint8_t Codebook::nearest(float value) const {
  return static_cast<std::uint8_t>(std::upper_bound(middles_.begin(), middles_.end(), value) -
                                   middles_.begin());
}

Palette make_palette(const VectorTable& vectors, std::size_t size, ThreadPool& pool) {
  Tree tree(vectors, pool);
  const std::vector<Node> leaves = tree.grow(size);
  Palette palette;
  palette.entries.resize(leaves.size() * vectors.dims);
  palette.labels.resize(vectors.count);
  pool.parallel_for(leaves.size(), [&](std::size_t leaf) {
    std::vector<double> sums(vectors.dims);
    const std::span<const std::uint32_t> members = tree.members(leaves[leaf]);
    for (const std::uint32_t i : members) {
      palette.labels[i] = static_cast<std::uint32_t>(leaf);
      for (std::size_t d = 0; d < vectors.dims; ++d) sums[d] += vectors[i][d];
    }
    for (std::size_t d = 0; d < vectors.dims; ++d)
      palette.entries[leaf * vectors.dims + d] =
          static_cast<float>(sums[d] / static_cast<double>(members.size()));
  });
  return palette;
}

}  // namespace catgs
