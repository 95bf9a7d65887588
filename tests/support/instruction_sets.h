// Runs code once with each instruction set that the kernels are compiled for and this CPU has.
#pragma once

#include <hwy/targets.h>

#include <cstdint>
#include <cstdio>
#include <string>

namespace brume {

// Those compared: without vectors, then wider and wider.
inline constexpr std::int64_t kInstructionSets[] = {HWY_STATIC_TARGET, HWY_SSE4, HWY_AVX2,
                                                    HWY_AVX3};

// For this process, until it goes out of scope. Not while other threads march.
class UseInstructionSet {
 public:
  explicit UseInstructionSet(std::int64_t set) { choose(set); }
  ~UseInstructionSet() { choose(0); }
  UseInstructionSet(const UseInstructionSet&) = delete;
  UseInstructionSet& operator=(const UseInstructionSet&) = delete;

  static bool is_here(std::int64_t set) {
    return set == HWY_STATIC_TARGET || (hwy::SupportedTargets() & set) != 0;
  }

 private:
  static void choose(std::int64_t set) {
    hwy::SetSupportedTargetsForTest(set);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  }
};

// Calls run(name) for each that is here and says which are not.
template <typename Run>
void for_each_instruction_set(Run&& run) {
  std::string lacking;
  for (const std::int64_t set : kInstructionSets) {
    if (!UseInstructionSet::is_here(set)) {
      lacking += std::string(" ") + hwy::TargetName(set);
      continue;
    }
    const UseInstructionSet use(set);
    run(hwy::TargetName(set));
  }
  if (!lacking.empty()) std::printf("Not tested, for this CPU lacks them:%s\n", lacking.c_str());
}

}  // namespace brume
