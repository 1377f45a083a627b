#pragma once

#include <cstdint>
#include <functional>
#include <stdexcept>

#include "server/base/clock.h"
#include "server/base/result_file.h"
#include "server/films/film_request.h"
#include "server/films/film_scene.h"

namespace catgs {

/// Called after each part of a picture and each frame of a film, and every 20 ms while they are put
/// together and written: with the share that is done, and the time since the call before. It may
/// wait, for others to have the machine, and may throw to cancel.
using OnDrawn = std::function<void(double share, Clock::duration took)>;

/// Why something is not drawn, in words for its author.
struct NotDrawn : std::runtime_error {
  using runtime_error::runtime_error;
};

/// The largest result, bytes.
inline constexpr std::uint64_t most_film_bytes = std::uint64_t{512} << 20;

/// Draws a picture (PNG) or a film (MP4, 30 frames a second) of the scene that `take` returns into
/// `file`, on this thread. Large pictures are drawn in parts. Throws NotDrawn, and other exceptions
/// with words for operators.
void draw_film(const FilmRequest& wanted, const FilmScene::Take& take, ResultFile& file,
               const OnDrawn& on_drawn);

}  // namespace catgs
