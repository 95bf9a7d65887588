// --verify and --max-rmse of bake and render: a cache's answers are checked before they are
// trusted.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>

#include "cli/command.h"
#include "cli/statistics.h"
#include "render/answer_check.h"

namespace brume {

struct SelfCheckOptions {
  std::optional<int> points;  // 0: none.
  std::optional<double> max_rmse;

  bool is_asked_for() const { return points.value_or(0) > 0 || max_rmse.has_value(); }
};
void add_self_check_options(CLI::App& verb, CommandContext& context, SelfCheckOptions& options);

// Throws Error(Usage) for a threshold without points.
void require_sense(const SelfCheckOptions& options);

// Checks where `request` asks and tells the result, in statistics as "verification"; nothing where
// that is switched off, or the request is for a part that answers nothing by itself (a shard, deep
// records).
std::optional<AnswerCheck> check_and_tell(const SelfCheckOptions& options,
                                          const CommandContext& context, const Lighting& lighting,
                                          const BakeSettings& settings,
                                          const IrradianceCache& cache, const BakeRequest& request,
                                          const Scattered& scattered, Statistics& statistics);

// Throws Error(Threshold) where the check says that --max-rmse is surely broken; `file` names the
// cache, if any.
void require_max_rmse(const SelfCheckOptions& options, const std::optional<AnswerCheck>& check,
                      const std::string& file);

Json check_json(const AnswerCheck& check);

}  // namespace brume
