// The Hilbert curve through a cube: neighbours along it are neighbours in space, so runs of it make
// small boxes. [Ham06] Hamilton, Compact Hilbert Indices, algorithm 2, as a table of states.
#pragma once

#include <array>
#include <bit>
#include <cstdint>

namespace brume {

namespace hilbert {

struct Step {
  std::uint8_t digit, next;
};

// A state is an entry corner (3 bits) and a direction of travel (0 to 2).
constexpr std::array<std::array<Step, 8>, 24> make_steps() {
  const auto rotate_left = [](unsigned x, unsigned by) {
    return ((x << by) | (x >> (3 - by))) & 7u;
  };
  std::array<std::array<Step, 8>, 24> steps{};
  for (unsigned entry = 0; entry < 8; ++entry)
    for (unsigned direction = 0; direction < 3; ++direction)
      for (unsigned octant = 0; octant < 8; ++octant) {
        const unsigned turn = (direction + 1) % 3;
        const unsigned gray = rotate_left(octant ^ entry, (3 - turn) % 3);
        const unsigned digit = gray ^ (gray >> 1) ^ (gray >> 2);
        // Where the curve enters that octant, and along which axis it goes through.
        const unsigned even = digit == 0 ? 0 : (digit - 1) & ~1u;
        const unsigned corner = even ^ (even >> 1);
        const unsigned odd = digit == 0 ? 0 : digit % 2 == 0 ? digit - 1 : digit;
        const unsigned axis = static_cast<unsigned>(std::countr_one(odd)) % 3;
        const unsigned next_entry = entry ^ rotate_left(corner, turn);
        const unsigned next_direction = (direction + axis + 1) % 3;
        steps[entry * 3 + direction][octant] = {
            static_cast<std::uint8_t>(digit), static_cast<std::uint8_t>(next_entry * 3 + next_direction)};
      }
  return steps;
}
inline constexpr auto kSteps = make_steps();

}  // namespace hilbert

// Place along the curve of a cell of a 2^bits cube; bits <= 21.
inline std::uint64_t hilbert_index(const std::array<std::uint32_t, 3>& cell, int bits) {
  std::uint64_t index = 0;
  std::uint8_t state = 0;
  for (int bit = bits - 1; bit >= 0; --bit) {
    const std::uint32_t octant =
        (cell[0] >> bit & 1) | (cell[1] >> bit & 1) << 1 | (cell[2] >> bit & 1) << 2;
    const hilbert::Step step = hilbert::kSteps[state][octant];
    index = index << 3 | step.digit;
    state = step.next;
  }
  return index;
}

}  // namespace brume
