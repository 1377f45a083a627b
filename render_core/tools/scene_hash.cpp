#include "render_core/tools/scene_hash.h"

#include <bit>
#include <cstring>

namespace catgs {
namespace {

/// Four independent lanes of multiply-rotate over 32-byte blocks. The speed of memory is the limit,
/// not the multiplier's latency.
class Hasher {
 public:
  template <typename T>
  void add(const std::vector<T>& values) {
    const auto* bytes = reinterpret_cast<const std::byte*>(values.data());
    std::size_t left = values.size() * sizeof(T);
    for (; left >= 32; left -= 32, bytes += 32) block(bytes);
    std::byte rest[32] = {};
    if (left > 0) std::memcpy(rest, bytes, left);
    block(rest);
    word(0, values.size());
  }
  [[nodiscard]] std::uint64_t value() const {
    std::uint64_t hash = 0;
    for (const std::uint64_t lane : lanes_) hash = step(hash, lane);
    return hash ^ (hash >> 32);
  }

 private:
  static std::uint64_t step(std::uint64_t state, std::uint64_t value) {
    constexpr std::uint64_t odd = 0x9e3779b97f4a7c15u;
    return (std::rotl(state, 29) ^ value) * odd;
  }
  void word(int lane, std::uint64_t value) { lanes_[lane] = step(lanes_[lane], value); }
  void block(const std::byte* bytes) {
    for (int lane = 0; lane < 4; ++lane) {
      std::uint64_t value = 0;
      std::memcpy(&value, bytes + 8 * lane, sizeof value);
      word(lane, value);
    }
  }

  std::uint64_t lanes_[4] = {1, 2, 3, 4};
};

}  // namespace

std::uint64_t scene_hash(const GaussianCloud& cloud) {
  Hasher hasher;
  hasher.add(cloud.mean);
  hasher.add(cloud.rotation);
  hasher.add(cloud.scale);
  hasher.add(cloud.opacity);
  hasher.add(cloud.sh);
  return hasher.value();
}

}  // namespace catgs
