#include "render_core/scene/tree/build_tree.h"

#include <algorithm>
#include <array>
#include <bit>
#include <limits>
#include <mutex>
#include <numeric>
#include <ostream>
#include <span>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <glm/common.hpp>

#include "render_core/base/error.h"
#include "render_core/base/part_file.h"
#include "render_core/scene/tree/gaussian_sorter.h"
#include "render_core/scene/tree/merge_nodes.h"

namespace catgs {
namespace {

/// Pages of leaves that are made at a time: work for every thread, and progress that is seen.
std::size_t pages_at_a_time(const ThreadPool& pool) {
  constexpr std::size_t least = 16, of_a_thread = 8;
  return std::max(least, of_a_thread * static_cast<std::size_t>(pool.threads()));
}

/// The first reading of a scene finds its extent. It keeps the parts where all of them fit into
/// memory.
struct FirstReading {
  std::uint64_t gaussians = 0, dropped = 0;
  SplatModel model = SplatModel::standard;
  int sh_degree = 0;
  glm::vec3 low{std::numeric_limits<float>::max()}, high{std::numeric_limits<float>::lowest()};
  std::vector<GaussianCloud> parts;

  void add(const GaussianCloud& part, std::size_t memory_bytes) {
    gaussians += part.size();
    model = part.model;
    sh_degree = part.sh_degree;
    for (const glm::vec3& mean : part.mean) {
      low = glm::min(low, mean);
      high = glm::max(high, mean);
    }
    if (GaussianCloud::bytes(gaussians, sh_degree) <= memory_bytes)
      parts.push_back(part);
    else
      parts.clear();
  }
};

/// A node without a page, until its parent's page is made.
struct LooseNode {
  NodeFacts facts;
  std::vector<std::byte> block;
};

/// Makes pages from the leaves upwards and writes them to their places.
class PageStream {
 public:
  PageStream(const TreeShape& shape, std::ostream& to, ThreadPool& pool)
      : shape_(shape),
        to_(to),
        pool_(pool),
        roots_(static_cast<std::size_t>(shape.bands())),
        done_(static_cast<std::size_t>(shape.bands())) {}

  [[nodiscard]] std::size_t gaussians_of_a_page() const {
    return cluster_size << (shape_.page_levels() - 1);
  }

  /// Leaves in the order of the curve. All calls but the last bring whole pages.
  void add(const GaussianCloud& gaussians) {
    const std::size_t each = gaussians_of_a_page();
    make_pages(0, (gaussians.size() + each - 1) / each,
               [&](TreePage& page, std::size_t index) { pack_leaves(gaussians, page, index); });
    for (int band = 1; band < shape_.bands(); ++band) make_band(band);
  }

  [[nodiscard]] std::array<TreeLevel, TreeHeader::most_levels> levels() const {
    auto levels = levels_;
    for (int l = 0; l < shape_.levels(); ++l) {
      const auto at = static_cast<std::size_t>(l);
      levels[at].mean_error =
          std::min(levels[at].max_error, static_cast<float>(error_sums_[at] / shape_.nodes_on(l)));
    }
    return levels;
  }

 private:
  /// Calls fill_lowest(page, i) for each of the next `count` pages of a band, then merges, writes
  /// and keeps the roots. A thread holds one page at a time.
  template <class FillLowest>
  void make_pages(int band, std::size_t count, const FillLowest& fill_lowest) {
    const auto b = static_cast<std::size_t>(band);
    std::vector<LooseNode>& roots = roots_[b];
    const std::size_t first = roots.size();
    roots.resize(first + count);
    std::vector<std::vector<NodeFacts>> facts(count);
    pool_.parallel_for(count, [&](std::size_t i) {
      TreePage page(shape_);
      fill_lowest(page, i);
      merge_upwards(band, page, done_[b] + i);
      page.seal(number(band, done_[b] + i));
      for (std::size_t slot = 0; slot < shape_.slots(); ++slot)
        facts[i].push_back(page.facts(slot));
      const auto block = std::as_const(page).block(0);
      roots[first + i] = {page.facts(0), {block.begin(), block.end()}};
      write(page, number(band, done_[b] + i));
    });
    // In order, since sums of errors round.
    for (const auto& of_page : facts) count_nodes(of_page, shape_.top_level(band));
    done_[b] += count;
  }

  /// Makes the pages of a band whose children are there.
  void make_band(int band) {
    std::vector<LooseNode>& children = roots_[static_cast<std::size_t>(band - 1)];
    const int lowest = band * shape_.page_levels();
    const std::size_t each = std::size_t{2} << (shape_.top_level(band) - lowest);
    const bool ended = done_[static_cast<std::size_t>(band - 1)] == shape_.pages_of(band - 1);
    const std::size_t count = ended ? (children.size() + each - 1) / each : children.size() / each;
    make_pages(band, count, [&](TreePage& page, std::size_t index) {
      const auto mine =
          std::span(children).subspan(index * each, std::min(each, children.size() - index * each));
      for (std::size_t i = 0; i < mine.size(); i += 2) {
        std::vector<NodeView> pair;
        for (const LooseNode& child : mine.subspan(i, std::min<std::size_t>(2, mine.size() - i)))
          pair.push_back({child.facts, child.block});
        const std::size_t slot = each / 2 - 1 + i / 2;
        page.facts(slot) = merge_nodes(pair, shape_.sh_degree(), page.block(slot));
      }
    });
    children.erase(children.begin(), children.begin() + static_cast<std::ptrdiff_t>(std::min(
                                                            children.size(), count * each)));
  }

  void pack_leaves(const GaussianCloud& gaussians, TreePage& page, std::size_t index) const {
    const std::size_t begin = index * gaussians_of_a_page();
    const std::size_t end = std::min(gaussians.size(), begin + gaussians_of_a_page());
    // The only page of a small tree has fewer levels.
    std::size_t slot = (std::size_t{1} << shape_.top_level(0)) - 1;
    for (std::size_t first = begin; first < end; first += cluster_size, ++slot) {
      std::array<std::uint32_t, cluster_size> all;
      const std::size_t count = std::min(cluster_size, end - first);
      std::iota(all.begin(), all.end(), static_cast<std::uint32_t>(first));
      const PackedCluster packed =
          pack_cluster(gaussians, std::span(all).first(count), page.block(slot));
      page.facts(slot) = {packed.units, packed.bounds, 0.0f, static_cast<std::uint32_t>(count), {}};
    }
  }

  /// Fills the slots above the lowest row of a page.
  void merge_upwards(int band, TreePage& page, std::uint64_t index) const {
    const int lowest = band * shape_.page_levels();
    for (int level = lowest + 1; level <= shape_.top_level(band); ++level) {
      const int depth = shape_.top_level(band) - level;
      const std::uint64_t first = index << depth;
      for (std::uint64_t i = first; i < first + (std::uint64_t{1} << depth); ++i) {
        if (i >= shape_.nodes_on(level)) break;
        const std::size_t slot = (std::size_t{1} << depth) - 1 + (i - first);
        std::vector<NodeView> pair;
        for (std::size_t child = 2 * slot + 1; child <= 2 * slot + 2; ++child)
          if (page.facts(child).count > 0)
            pair.push_back({page.facts(child), std::as_const(page).block(child)});
        page.facts(slot) = merge_nodes(pair, shape_.sh_degree(), page.block(slot));
      }
    }
  }

  void write(const TreePage& page, std::uint64_t number) {
    const std::lock_guard lock(writing_);
    to_.seekp(static_cast<std::streamoff>(shape_.page_offset(number)));
    to_.write(reinterpret_cast<const char*>(page.bytes().data()),
              static_cast<std::streamsize>(page.bytes().size()));
  }

  void count_nodes(std::span<const NodeFacts> of_page, int root_level) {
    for (std::size_t slot = 0; slot < of_page.size(); ++slot) {
      const NodeFacts& facts = of_page[slot];
      if (facts.count == 0) continue;
      const std::size_t level = root_level + 1u - std::bit_width(slot + 1);
      levels_[level].gaussians += facts.count;
      levels_[level].max_error = std::max(levels_[level].max_error, facts.error);
      error_sums_[level] += static_cast<double>(facts.error);
    }
  }

  [[nodiscard]] std::uint64_t number(int band, std::uint64_t index) const {
    return shape_.page(band, static_cast<std::uint32_t>(index));
  }

  const TreeShape& shape_;
  std::ostream& to_;
  std::mutex writing_;
  ThreadPool& pool_;
  std::vector<std::vector<LooseNode>> roots_;  // by band: those whose parents are not made yet
  std::vector<std::uint64_t> done_;            // pages, by band
  std::array<TreeLevel, TreeHeader::most_levels> levels_{};
  std::array<double, TreeHeader::most_levels> error_sums_{};
};

FirstReading read_first(const SceneParts& scene, const std::filesystem::path& out,
                        std::size_t memory_bytes) {
  FirstReading first;
  first.dropped = scene.each(
      [&](const GaussianCloud& part) { first.add(part, scene.in_memory ? 0 : memory_bytes); });
  if (first.gaussians == 0)
    throw InputError(out.string(), "", "there are no Gaussians to build a tree of");
  if (first.gaussians > TreeShape::max_gaussians)
    throw InputError(out.string(), "",
                     fmt::format("{} Gaussians, a tree has at most {}", first.gaussians,
                                 TreeShape::max_gaussians),
                     "split the scene");
  return first;
}

/// Now, and not after an hour. The sorter gives its disk back while the tree grows.
void check_space(const std::filesystem::path& out, const TreeShape& shape,
                 std::size_t memory_bytes) {
  const std::uint64_t sorting = GaussianSorter::disk_bytes(shape.gaussians(), shape.sh_degree());
  const std::uint64_t needed = std::max(shape.file_bytes(), sorting > memory_bytes ? sorting : 0);
  std::error_code error;
  const auto space = std::filesystem::space(std::filesystem::absolute(out).parent_path(), error);
  if (!error && space.available < needed)
    throw InputError(out.string(), "",
                     fmt::format("needs {:.1f} GB of disk, {:.1f} GB are free",
                                 1e-9 * static_cast<double>(needed),
                                 1e-9 * static_cast<double>(space.available)),
                     "free some, or write elsewhere");
}

}  // namespace

TreeHeader build_tree(const SceneParts& scene, const std::filesystem::path& out,
                      std::size_t memory_bytes, ThreadPool& pool, const LoadContext& context) {
  constexpr double measured = 0.1, sorted = 0.3;  // of the time, about
  PartFile file(out, PartFile::Special::replaced);
  FirstReading first = read_first(scene, out, memory_bytes);
  context.report(measured);
  const TreeShape shape(first.gaussians, first.sh_degree);
  check_space(out, shape, memory_bytes);

  GaussianSorter sorter(MortonCurve(first.low, first.high), first.gaussians, first.sh_degree,
                        memory_bytes, out, pool);
  std::uint64_t done = 0;
  const auto share = [&] {
    return static_cast<double>(done) / static_cast<double>(first.gaussians);
  };
  const auto sort = [&](const GaussianCloud& part) {
    sorter.add(part);
    done += part.size();
    context.report(measured + (sorted - measured) * share());
  };
  if (first.parts.empty()) scene.each(sort);
  for (GaussianCloud& part : first.parts) {
    sort(part);
    part = {};
  }
  sorter.finish();

  PageStream pages(shape, file.stream(), pool);
  GaussianCloud gaussians;
  for (done = 0; done < first.gaussians; done += gaussians.size()) {
    sorter.next(pages_at_a_time(pool) * pages.gaussians_of_a_page(), gaussians);
    pages.add(gaussians);
    context.report(sorted + (1.0 - sorted) * share());
  }

  TreeHeader header;
  header.sh_degree = static_cast<std::uint16_t>(first.sh_degree);
  header.model = first.model;
  header.gaussians = first.gaussians;
  header.low = first.low;
  header.high = first.high;
  header.dropped = first.dropped;
  header.read = header.gaussians + header.dropped;
  scene.format.copy(header.source.data(), header.source.size() - 1);
  header.levels = pages.levels();
  header.checksum = header.right_checksum();
  header.origin = scene.origin;
  header.origin_checksum = header.right_origin_checksum();
  file.stream().seekp(0);
  file.stream().write(reinterpret_cast<const char*>(&header), sizeof header);
  file.finish();
  context.report(1.0);
  return header;
}

}  // namespace catgs
