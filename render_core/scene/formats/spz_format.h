#pragma once

#include <cassert>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

// Constants of the .spz format that its reader and its writer share.
namespace catgs::spz {

inline constexpr std::uint32_t magic = 0x5053474e;     // "NGSP"
inline constexpr std::size_t gzip_header_bytes = 16;   // versions 1 to 3, inside the gzip stream
inline constexpr std::size_t plain_header_bytes = 32;  // version 4
inline constexpr std::uint8_t antialiased_flag = 0x1, extensions_flag = 0x2;
inline constexpr std::uint32_t safe_orbit_extension = 0xadbe0002;
inline constexpr std::uint32_t coordinate_system_extension = 0xadbe0003;

/// The constant SH coefficient is stored with less contrast than a colour, so that values slightly
/// outside of [0, 1] fit.
inline constexpr float colour_scale = 0.15f;
inline constexpr float most_sh0 = 0.5f / colour_scale;

/// A byte of a scale stands for its logarithm: byte / 16 - 10.
inline constexpr float least_log_scale = -10.0f, log_scale_steps = 16.0f;

/// Quaternion components are a sign and a magnitude up to this, which stands for sqrt(1/2).
inline constexpr std::uint32_t max_magnitude = 511;
inline constexpr float magnitude_unit = 0.70710678f / static_cast<float>(max_magnitude);

/// Right, up, back, the axes of every file without an extension.
inline constexpr glm::vec3 right_up_back(1.0f, -1.0f, -1.0f);  // signs to right, down, front
inline constexpr std::uint32_t right_up_back_system = 4;

// The coordinate system extension numbers systems in binary, from 1 on. Bit 0: x points right (not
// left). Bit 1: up (not down). Bit 2: front (not back). Of systems 1…8 the second and third axes
// are y and z. Systems 9…16 are these, turned about x until z is the second.
//
// The names that the reference library gives to 9…16 promise the same, but for 9, 10, 15 and 16
// (LFD, RFD, LBU, RBU) its conversion lies half a turn about x away from them. We do as it does: it
// is what writes such files, and what was turned there from right, down, front (.ply) or right, up,
// back must be turned back.
inline constexpr std::uint32_t first_z_up_system = 9, last_system = 16;

/// Signs for the systems 1…8.
inline glm::vec3 signs_to_right_down_front(std::uint32_t system) {
  assert(system >= 1 && system < first_z_up_system);
  const std::uint32_t bits = system - 1;
  return {bits & 1 ? 1.0f : -1.0f, bits & 2 ? -1.0f : 1.0f, bits & 4 ? 1.0f : -1.0f};
}

/// The map to right, down, front for the systems 9…16.
inline glm::dmat3 z_up_to_right_down_front(std::uint32_t system) {
  assert(system >= first_z_up_system && system <= last_system);
  const glm::dvec3 signs(signs_to_right_down_front(system - first_z_up_system + 1));
  return {signs.x, 0.0, 0.0, 0.0, 0.0, -signs.y, 0.0, signs.z, 0.0};
}

}  // namespace catgs::spz
