#pragma once

#include <cstdint>
#include <optional>

namespace catgs {

/// Figures of a scene in pages on one device, and of the pool of pages that it shares.
struct PageFigures {
  std::optional<int> device{};  // nothing: in main memory
  // The scene's.
  std::uint32_t in_memory = 0;   // pages now
  std::uint32_t missing = 0;     // wanted at the pool's last update, and there is room for them
  std::uint64_t loaded = 0;      // pages since the scene came into memory
  std::uint64_t unreadable = 0;  // pages that were asked for and are damaged
  // The pool's.
  std::uint32_t slots = 0, free_slots = 0;  // of one page
  std::uint64_t pool_bytes = 0;
};

}  // namespace catgs
