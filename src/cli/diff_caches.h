// How one cache differs from another: settings, records by key, and answers.
#pragma once

#include <string>
#include <vector>

#include "cli/command.h"

namespace brume {

// `limits` are texts METRIC=V. Returns 0; throws Error(Threshold) where a metric is above its
// limit, Error(InvalidInput) for what is no complete cache.
int diff_caches(const std::string& a, const std::string& b, const std::vector<std::string>& limits,
                const CommandContext& context);

}  // namespace brume
