#include "render_core/scene/tree/gaussian_sorter.h"

#include <algorithm>
#include <cassert>
#include <cerrno>
#include <cstring>
#include <functional>
#include <string>
#include <system_error>

#include <fcntl.h>
#include <unistd.h>

#include "render_core/base/error.h"
#include "render_core/scene/formats/load_context.h"

namespace catgs {
namespace {

constexpr std::size_t fewest_in_memory = 4096;
constexpr std::size_t block_rows = 4096;  // that a thread copies at a time

// A record: mean, rotation, scale, opacity, harmonics.
constexpr std::size_t record_bytes(int sh_degree) { return GaussianCloud::bytes(1, sh_degree); }

template <class T>
std::byte* put(std::byte* to, const T* from, std::size_t count = 1) {
  std::memcpy(to, from, count * sizeof(T));
  return to + count * sizeof(T);
}
template <class T>
const std::byte* get(const std::byte* from, T* to, std::size_t count = 1) {
  std::memcpy(to, from, count * sizeof(T));
  return from + count * sizeof(T);
}

}  // namespace

// --- ScratchFile ---

ScratchFile::ScratchFile(const std::filesystem::path& beside) : beside_(beside) {
  std::string name = beside.string() + ".XXXXXX";
  descriptor_ = ::mkostemp(name.data(), O_CLOEXEC);
  if (descriptor_ < 0)
    throw InputError(name, "", "cannot be written: " + std::generic_category().message(errno));
  ::unlink(name.c_str());
}

ScratchFile::~ScratchFile() { ::close(descriptor_); }

void ScratchFile::write(std::uint64_t offset, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t done =
        ::pwrite(descriptor_, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (done < 0 && errno == EINTR) continue;
    if (done <= 0)
      throw InputError(beside_.string(), "sorting on disk", std::generic_category().message(errno),
                       "more memory or more space on the disk");
    bytes = bytes.subspan(static_cast<std::size_t>(done));
    offset += static_cast<std::uint64_t>(done);
  }
}

void ScratchFile::read(std::uint64_t offset, std::span<std::byte> to) const {
  while (!to.empty()) {
    const ssize_t done = ::pread(descriptor_, to.data(), to.size(), static_cast<off_t>(offset));
    if (done < 0 && errno == EINTR) continue;
    if (done <= 0)
      throw InputError(beside_.string(), "sorting on disk", std::generic_category().message(errno));
    to = to.subspan(static_cast<std::size_t>(done));
    offset += static_cast<std::uint64_t>(done);
  }
}

void ScratchFile::forget(std::uint64_t offset, std::uint64_t size) {
  // Without holes the disk is merely fuller for a while.
  [[maybe_unused]] const int result =
      ::fallocate(descriptor_, FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE,
                  static_cast<off_t>(offset), static_cast<off_t>(size));
}

// --- GaussianSorter ---

GaussianSorter::GaussianSorter(const MortonCurve& curve, std::uint64_t gaussians, int sh_degree,
                               std::size_t memory_bytes, std::filesystem::path beside,
                               ThreadPool& pool)
    : curve_(curve),
      degree_(sh_degree),
      record_bytes_(record_bytes(sh_degree)),
      memory_bytes_(memory_bytes),
      capacity_(std::min<std::uint64_t>(
          gaussians,
          std::max(fewest_in_memory, memory_bytes / (record_bytes_ + 2 * sizeof(CodedIndex))))),
      beside_(std::move(beside)),
      pool_(pool),
      records_(std::make_unique_for_overwrite<std::byte[]>(capacity_ * record_bytes_)) {
  codes_.reserve(capacity_);
}

std::uint64_t GaussianSorter::disk_bytes(std::uint64_t gaussians, int sh_degree) {
  return gaussians * record_bytes(sh_degree);
}

std::uint64_t GaussianSorter::code_of(const std::byte* record) const {
  glm::vec3 mean;
  get(record, &mean);
  return curve_.code(mean);
}

void GaussianSorter::add(const GaussianCloud& part) {
  assert(part.sh_degree == degree_);
  const auto sh_count = static_cast<std::size_t>(part.sh_count());
  for (std::size_t first = 0; first < part.size();) {
    if (codes_.size() == capacity_) spill();
    const std::size_t begin = codes_.size();
    const std::size_t count = std::min(part.size() - first, capacity_ - begin);
    codes_.resize(begin + count);
    LoadContext(pool_).for_blocks(count, block_rows, [&](std::size_t from, std::size_t end) {
      for (std::size_t k = from; k < end; ++k) {
        const std::size_t i = first + k, index = begin + k;
        codes_[index] = {curve_.code(part.mean[i]), static_cast<std::uint32_t>(index)};
        std::byte* to = put(record(index), &part.mean[i]);
        to = put(to, &part.rotation[i]);
        to = put(to, &part.scale[i]);
        to = put(to, &part.opacity[i]);
        put(to, part.sh_of(i), sh_count);
      }
    });
    first += count;
  }
}

void GaussianSorter::sort_codes() {
  scratch_codes_.resize(codes_.size());
  sorter_.sort(codes_, scratch_codes_, 63, pool_);
}

void GaussianSorter::spill() {
  if (!file_) file_ = std::make_unique<ScratchFile>(beside_);
  sort_codes();
  const std::uint64_t begin = runs_.empty() ? 0 : runs_.back().end;
  LoadContext(pool_).for_blocks(codes_.size(), block_rows, [&](std::size_t from, std::size_t to) {
    std::vector<std::byte> buffer((to - from) * record_bytes_);
    for (std::size_t k = from; k < to; ++k)
      std::memcpy(&buffer[(k - from) * record_bytes_], record(codes_[k].value), record_bytes_);
    file_->write(begin + from * record_bytes_, buffer);
  });
  runs_.push_back({begin, begin + codes_.size() * record_bytes_, {}});
  codes_.clear();
}

void GaussianSorter::finish() {
  if (!file_) return sort_codes();
  if (!codes_.empty()) spill();
  // The buffers of the runs need the memory, and an assignment of {} would keep it.
  records_.reset();
  std::vector<CodedIndex>().swap(codes_);
  std::vector<CodedIndex>().swap(scratch_codes_);
  const std::size_t rows =
      std::max<std::size_t>(16, memory_bytes_ / 2 / runs_.size() / record_bytes_);
  for (std::size_t r = 0; r < runs_.size(); ++r) {
    runs_[r].buffer.resize(std::min(rows * record_bytes_, runs_[r].end - runs_[r].offset));
    runs_[r].at = runs_[r].buffer.size();
    if (refill(runs_[r])) heads_.emplace(code_of(runs_[r].buffer.data()), r);
  }
}

bool GaussianSorter::refill(Run& run) {
  if (run.at < run.buffer.size()) return true;
  run.buffer.resize(std::min<std::uint64_t>(run.buffer.size(), run.end - run.offset));
  if (run.buffer.empty()) return false;
  file_->read(run.offset, run.buffer);
  file_->forget(run.offset, run.buffer.size());
  run.offset += run.buffer.size();
  run.at = 0;
  return true;
}

void GaussianSorter::load(const std::byte* record, GaussianCloud& cloud, std::size_t i) const {
  const auto sh_count = static_cast<std::size_t>(cloud.sh_count());
  record = get(record, &cloud.mean[i]);
  record = get(record, &cloud.rotation[i]);
  record = get(record, &cloud.scale[i]);
  record = get(record, &cloud.opacity[i]);
  get(record, cloud.sh.data() + i * sh_count, sh_count);
}

void GaussianSorter::next(std::size_t count, GaussianCloud& cloud) {
  if (!file_) {
    const std::size_t end = std::min(codes_.size(), taken_ + count);
    cloud.resize(end - taken_, degree_);
    LoadContext(pool_).for_blocks(cloud.size(), block_rows, [&](std::size_t from, std::size_t to) {
      for (std::size_t i = from; i < to; ++i) load(record(codes_[taken_ + i].value), cloud, i);
    });
    taken_ = end;
    return;
  }
  cloud.resize(count, degree_);
  std::size_t i = 0;
  for (; i < count && !heads_.empty(); ++i) {
    // The earlier run comes first among equal codes, since it was added before.
    const std::size_t r = heads_.top().second;
    heads_.pop();
    Run& run = runs_[r];
    load(&run.buffer[run.at], cloud, i);
    run.at += record_bytes_;
    if (refill(run)) heads_.emplace(code_of(&run.buffer[run.at]), r);
  }
  cloud.resize(i, degree_);
}

}  // namespace catgs
