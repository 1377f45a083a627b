#include "tests/fuzz/target.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numeric>
#include <stdexcept>
#include <system_error>

#include <glm/common.hpp>
#include <sys/mman.h>
#include <unistd.h>

#include "render_core/scene/files/sanitize.h"
#include "tests/render_core/scene/random_cloud.h"

namespace catgs::fuzz {

const std::vector<Target>& targets() {
  static const std::vector<Target> all = [] {
    std::vector<Target> joined;
    for (const auto& of_file :
         {ply_targets(), splat_spz_targets(), gltf_targets(), levels_targets(), sog_targets(),
          scene_json_targets(), text_files_targets(), scene_size_targets(), tree_targets(),
          walk_targets(), network_targets()})
      joined.insert(joined.end(), of_file.begin(), of_file.end());
    return joined;
  }();
  return all;
}

const Target& target_called(std::string_view name) {
  std::string names;
  for (const Target& target : targets()) {
    if (target.name == name) return target;
    names += " " + target.name;
  }
  throw std::out_of_range("no target '" + std::string(name) + "'; there are:" + names);
}

void require(bool promise, const char* what) {
  if (promise) return;
  std::fprintf(stderr, "broken promise: %s\n", what);
  std::abort();
}

const LoadContext& one_thread() {
  static ThreadPool pool(1);
  static const LoadContext context(pool);
  return context;
}

void require_sound(GaussianCloud cloud) {
  require(cloud.sh.size() == cloud.size() * static_cast<std::size_t>(cloud.sh_count()),
          "one set of coefficients for each Gaussian");
  sanitize(cloud, one_thread());
  const auto finite = [](const auto& v) {
    for (int k = 0; k < v.length(); ++k)
      if (!std::isfinite(v[k])) return false;
    return true;
  };
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    require(finite(cloud.mean[i]) && finite(cloud.scale[i]) && finite(cloud.rotation[i]),
            "sanitized values are finite");
    require(cloud.opacity[i] > 0.0f && cloud.opacity[i] < 1.0f, "opacities are in (0, 1)");
  }
  for (const glm::vec3& sh : cloud.sh) require(finite(sh), "sanitized colours are finite");
}

/// M. D. McIlroy, A Killer Adversary for Quicksort, 1999: numbers are chosen while they are sorted.
std::vector<std::size_t> hard_to_sort(std::size_t count) {
  std::vector<std::size_t> numbers(count, count);  // not chosen yet: larger than all others
  std::size_t chosen = 0;
  std::size_t pivot = 0;  // presumably
  std::vector<std::size_t> places(count);
  std::iota(places.begin(), places.end(), std::size_t{0});
  std::sort(places.begin(), places.end(), [&](std::size_t a, std::size_t b) {
    if (numbers[a] == count && numbers[b] == count) numbers[a == pivot ? a : b] = chosen++;
    if (numbers[a] == count)
      pivot = a;
    else if (numbers[b] == count)
      pivot = b;
    return numbers[a] < numbers[b];
  });
  return numbers;
}

GaussianCloud cloud_hard_to_sort() {
  GaussianCloud cloud = test::random_cloud(64, 0);
  const std::vector<std::size_t> numbers = hard_to_sort(cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i)
    cloud.mean[i] = glm::vec3(static_cast<float>(numbers[i]));
  return cloud;
}

std::string text_of(Bytes input) {
  return {reinterpret_cast<const char*>(input.data()), input.size()};
}

Bytes bytes_of(const std::string& text) { return std::as_bytes(std::span(text)); }

FileInMemory::FileInMemory(Bytes content) : descriptor_(::memfd_create("input", MFD_CLOEXEC)) {
  rewrite(content);
}

FileInMemory::~FileInMemory() { ::close(descriptor_); }

void FileInMemory::rewrite(Bytes content) {
  if (::ftruncate(descriptor_, 0) != 0 || ::pwrite(descriptor_, content.data(), content.size(),
                                                   0) != static_cast<ssize_t>(content.size()))
    throw std::system_error(errno, std::generic_category(), "memfd");
}

std::string FileInMemory::path() const { return "/proc/self/fd/" + std::to_string(descriptor_); }

}  // namespace catgs::fuzz
