// The `head` script. Its constants are fitted to recorded head motion of twelve people in 3DGS
// scenes (EyeNavGS). Their angular speed has 8 deg/s at p10, 27 at the median, 66 at p90 and 138 at
// p99, yaw twice as fast as pitch and roll. Their heads move at 0.2 m/s at the median, 0.5 at p90.
#include <algorithm>
#include <numbers>

#include <glm/common.hpp>

#include "render_core/motion/portable.h"
#include "render_core/motion/script_parts.h"

namespace catgs {
namespace {

constexpr double degree = std::numbers::pi / 180.0;

/// Minimum-jerk moves of a 3-vector with rests between them.
class Moves {
 public:
  explicit Moves(const glm::dvec3& start) { moves_.push_back({0.0, 0.0, start, start}); }

  [[nodiscard]] double end_s() const { return moves_.back().end_s; }
  [[nodiscard]] const glm::dvec3& last() const { return moves_.back().to; }
  void add(double rest_s, double duration_s, const glm::dvec3& to) {
    moves_.push_back({end_s() + rest_s, end_s() + rest_s + duration_s, last(), to});
  }
  [[nodiscard]] glm::dvec3 at(double time_s) const {
    const auto next =
        std::upper_bound(moves_.begin(), moves_.end(), time_s,
                         [](double time, const Move& move) { return time < move.start_s; });
    if (next == moves_.begin()) return next->from;
    const Move& move = *std::prev(next);
    if (time_s >= move.end_s) return move.to;
    return glm::mix(move.from, move.to,
                    minimum_jerk((time_s - move.start_s) / (move.end_s - move.start_s)));
  }

 private:
  struct Move {
    double start_s, end_s;
    glm::dvec3 from, to;
  };
  std::vector<Move> moves_;
};

/// Turns of the head to new points of interest, as (yaw, pitch, roll) offsets in radians.
Moves make_turns(PortableRng& rng, double duration_s) {
  constexpr double widest_yaw = 120.0 * degree;  // people turn back before they turn farther
  Moves turns(glm::dvec3(0.0));
  while (turns.end_s() < duration_s) {
    const double u = rng.uniform(0.0, 1.0);
    const double size = (7.0 + 130.0 * u * u * u * u) * degree;  // many small turns, few large ones
    double yaw = turns.last().x + (rng.coin() ? size : -size);
    if (std::abs(yaw) > widest_yaw) yaw = turns.last().x + (yaw > 0.0 ? -size : size);
    const glm::dvec3 to{yaw, 9.0 * degree * rng.normal(), 4.0 * degree * rng.normal()};
    const double v = rng.uniform(0.0, 1.0);
    const double slowness = rng.uniform(0.9, 2.0);
    turns.add(0.05 + 1.1 * v * v, (0.40 + 0.0085 * size / degree) * slowness, to);
  }
  return turns;
}

/// Steps and short walks around the start, as ground offsets (right, up, forward) in metres.
Moves make_steps(PortableRng& rng, double duration_s) {
  constexpr double reach_m = 0.9;
  Moves steps(glm::dvec3(0.0));
  while (steps.end_s() < duration_s) {
    const glm::dvec3 to{reach_m * rng.uniform(-1.0, 1.0),
                        0.12 * std::min(0.0, rng.normal()),  // people crouch but do not fly
                        reach_m * rng.uniform(-1.0, 1.0)};
    const double rest_s = rng.uniform(0.0, 2.5);
    const double speed_m_s = rng.uniform(0.25, 0.45);
    steps.add(rest_s, 0.6 + glm::length(to - steps.last()) / speed_m_s, to);
  }
  return steps;
}

}  // namespace

PoseAt head_script(const SceneFrame& frame, std::uint64_t seed, double duration_s) {
  PortableRng rng(seed);
  const Moves turns = make_turns(rng, duration_s);
  const Moves steps = make_steps(rng, duration_s);
  const std::uint64_t noise_seed = rng.next();
  return [=](double time_s) {
    // The sum of two noises half a cell apart, because a single one stands still at every lattice
    // point.
    const auto noise = [&](std::uint32_t channel, double rate_hz) {
      const double x = time_s * rate_hz;
      return value_noise(noise_seed, 2 * channel, x) +
             value_noise(noise_seed, 2 * channel + 1, x + 0.5);
    };
    // A head at rest still sways, twice as fast about the vertical axis as about the others.
    const glm::dvec3 sway =
        degree * glm::dvec3(10.5 * noise(0, 1.1), 6.5 * noise(1, 1.3), 5.0 * noise(2, 1.2));
    const glm::dvec3 lean_m(0.09 * noise(3, 0.6), 0.03 * noise(4, 0.6), 0.09 * noise(5, 0.6));
    const glm::dvec3 offset = frame.metre() * (steps.at(time_s) + lean_m);
    const glm::dvec3 position = frame.start() + frame.right() * offset.x + frame.up() * offset.y +
                                frame.forward() * offset.z;
    return Pose{frame.inside(position), glm::quat(frame.turned(turns.at(time_s) + sway))};
  };
}

}  // namespace catgs
