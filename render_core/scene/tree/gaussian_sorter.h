#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <queue>
#include <span>
#include <utility>
#include <vector>

#include "render_core/base/radix_sort.h"
#include "render_core/base/thread_pool.h"
#include "render_core/scene/clusters.h"
#include "render_core/scene/gaussian_cloud.h"

namespace catgs {

/// A file without a name, which the system removes with the process.
class ScratchFile {
 public:
  /// `beside`: a path in the folder whose disk is used. Throws InputError, as the others do.
  explicit ScratchFile(const std::filesystem::path& beside);
  ~ScratchFile();
  ScratchFile(const ScratchFile&) = delete;
  ScratchFile& operator=(const ScratchFile&) = delete;

  /// May be called from several threads.
  void write(std::uint64_t offset, std::span<const std::byte> bytes);
  void read(std::uint64_t offset, std::span<std::byte> to) const;
  /// Gives the blocks of a range back to the disk, where the file system can.
  void forget(std::uint64_t offset, std::uint64_t size);

 private:
  std::filesystem::path beside_;
  int descriptor_;
};

/// Sorts Gaussians along a Morton curve in bounded memory: sorted runs that fill the memory go to
/// disk and are merged as they are read. The order is that of morton_order(), and does not depend
/// on the memory: equal codes keep the order in which they were added. A Gaussian keeps every bit.
class GaussianSorter {
 public:
  /// For `gaussians` that will be added. Holds at most `memory_bytes`, but no less than 4096
  /// Gaussians. `beside`: as for ScratchFile, which is made when memory does not suffice.
  GaussianSorter(const MortonCurve& curve, std::uint64_t gaussians, int sh_degree,
                 std::size_t memory_bytes, std::filesystem::path beside, ThreadPool& pool);

  void add(const GaussianCloud& part);
  /// Ends adding. Call once, before next().
  void finish();
  /// Replaces the cloud by the next `count` Gaussians of the order, fewer at its end.
  void next(std::size_t count, GaussianCloud& cloud);

  /// Bytes of disk for so many Gaussians, if they do not fit into memory.
  static std::uint64_t disk_bytes(std::uint64_t gaussians, int sh_degree);

 private:
  /// A sorted part of the scratch file, read through a buffer.
  struct Run {
    std::uint64_t offset, end;  // bytes not yet in the buffer
    std::vector<std::byte> buffer;
    std::size_t at = 0;
  };
  using Head = std::pair<std::uint64_t, std::size_t>;  // code of a run's next Gaussian, the run

  [[nodiscard]] std::byte* record(std::size_t i) { return records_.get() + i * record_bytes_; }
  [[nodiscard]] std::uint64_t code_of(const std::byte* record) const;
  void sort_codes();
  void spill();
  bool refill(Run& run);
  void load(const std::byte* record, GaussianCloud& cloud, std::size_t i) const;

  MortonCurve curve_;
  int degree_;
  std::size_t record_bytes_, memory_bytes_, capacity_;
  std::filesystem::path beside_;
  ThreadPool& pool_;
  std::unique_ptr<std::byte[]> records_;
  std::vector<CodedIndex> codes_, scratch_codes_;
  RadixSorter sorter_;
  std::size_t taken_ = 0;  // of codes_, without runs
  std::unique_ptr<ScratchFile> file_;
  std::vector<Run> runs_;
  std::priority_queue<Head, std::vector<Head>, std::greater<>> heads_;
};

}  // namespace catgs
