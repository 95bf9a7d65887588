// --verify and --max-rmse of bake and render: a cache's answers are checked before they are
// trusted.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>

#include "cli/command.h"
#include "cli/statistics.h"
#include "render/check_answers.h"

namespace brume {

struct SelfCheckOptions {
  std::optional<int> points;  // 0: none.
  std::optional<double> max_rmse;

  bool is_asked_for() const { return points.value_or(0) > 0 || max_rmse.has_value(); }
};
void add_self_check_options(CLI::App& verb, CommandContext& context, SelfCheckOptions& options);

// Throws Error(Usage) for a threshold without points.
void require_sense(const SelfCheckOptions& options);

// Checks where `request` asks, by truths that are known where they are (CacheSession::known_check());
// nothing where that is switched off or only deep records are wanted.
std::optional<CheckedRequest> check_request(const SelfCheckOptions& options,
                                            const Lighting& lighting, const BakeSettings& settings,
                                            const IrradianceCache& cache,
                                            const BakeRequest& request, const Scattered& scattered,
                                            const std::optional<CheckedRequest>& known,
                                            Statistics& statistics);

// Tells the result, in statistics as "verification", with a warning where it is doubtful; nothing
// where nothing was checked.
std::optional<AnswerCheck> tell_check(const std::optional<CheckedRequest>& checked,
                                      const IrradianceCache& cache, const CommandContext& context,
                                      Statistics& statistics);

// Throws Error(Threshold) where the check says that --max-rmse is surely broken; `file` names the
// cache, if any.
void require_max_rmse(const SelfCheckOptions& options, const std::optional<AnswerCheck>& check,
                      const std::string& file);

// "verified at 64 points: bias ...".
std::string check_sentence(const AnswerCheck& check);
Json check_json(const AnswerCheck& check);

}  // namespace brume
