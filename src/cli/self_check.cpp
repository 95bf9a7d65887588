#include "cli/self_check.h"

#include <cstdio>

#include "cli/environment.h"
#include "cli/text_table.h"
#include "cli/values.h"
#include "core/error.h"

namespace brume {
namespace {

std::string percent(double part) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2g %%", 100 * part);
  return text;
}

}  // namespace

std::string check_sentence(const AnswerCheck& c) {
  return "verified at " + std::to_string(c.points) + " points: bias " + percent(c.bias) + " +- " +
         percent(c.bias_error) + ", RMSE " + percent(c.rmse) + " (at most " + percent(c.rmse_high) +
         ")";
}

void add_self_check_options(CLI::App& verb, CommandContext& context, SelfCheckOptions& options) {
  with_environment(
      context, verb,
      add_integer(verb, "--verify", options.points, 0, 10'000'000,
                  "Points of what is asked for at which answers are compared with traced paths; 0: "
                  "none (default 64)"))
      ->group("Verification");
  add_number(verb, "--max-rmse", options.max_rmse, 0, 1e6,
             "Exit code 5 where the relative RMSE at those points is surely above this: by two "
             "standard errors of its square")
      ->group("Verification");
}

void require_sense(const SelfCheckOptions& options) {
  if (options.max_rmse && options.points == 0)
    throw Error(ErrorKind::Usage,
                "--max-rmse: nothing is verified with --verify 0: ask for points, or leave it out");
}

Json check_json(const AnswerCheck& c) {
  Json all = Json::object();
  all["points"] = c.points;
  all["gathered"] = c.gathered;
  all["paths"] = c.paths;
  all["truth"] = c.truth;
  all["answer"] = c.answer;
  all["bias"] = c.bias;
  all["bias_error"] = c.bias_error;
  all["rmse"] = c.rmse;
  all["rmse_low"] = c.rmse_low;
  all["rmse_high"] = c.rmse_high;
  all["worst"] = {{"position", json_of(c.worst_position)},
                  {"truth", c.worst_truth},
                  {"truth_error", c.worst_truth_error},
                  {"answer", c.worst_answer}};
  return all;
}

std::optional<CheckedRequest> check_request(const SelfCheckOptions& options,
                                            const Lighting& lighting, const BakeSettings& settings,
                                            const IrradianceCache& cache,
                                            const BakeRequest& request, const Scattered& scattered,
                                            const std::optional<CheckedRequest>& known,
                                            Statistics& statistics) {
  const int count = options.points.value_or(kCheckedPoints);
  if (count == 0 || request.deep_only) return std::nullopt;
  CheckedRequest checked = statistics.timed("verify", [&] {
    return check_answers(lighting, settings, cache, request, count, scattered,
                         known ? &*known : nullptr);
  });
  if (checked.points.empty()) return std::nullopt;
  return checked;
}

std::optional<AnswerCheck> tell_check(const std::optional<CheckedRequest>& checked,
                                      const IrradianceCache& cache, const CommandContext& context,
                                      Statistics& statistics) {
  if (!checked) return std::nullopt;
  const AnswerCheck check = summarise({*checked}, cache.records(), cache.origin());
  if (check.points == 0) return std::nullopt;
  statistics.details["verification"] = check_json(check);
  if (!check.is_doubtful()) {
    context.note(check_sentence(check));
    return check;
  }
  const Vec3d& p = check.worst_position;
  context.warn("answers of records are off: " + check_sentence(check) + "; at " +
               shown_number(p.x) + "," + shown_number(p.y) + "," + shown_number(p.z) +
               " they say " + shown_number(check.worst_answer) + " where paths find " +
               shown_number(check.worst_truth) +
               ": bake anew with a smaller --error or more --cells");
  return check;
}

void require_max_rmse(const SelfCheckOptions& options, const std::optional<AnswerCheck>& check,
                      const std::string& file) {
  if (!options.max_rmse || !check) return;
  if (check->rmse_low <= *options.max_rmse) return;
  throw Error(ErrorKind::Threshold, (file.empty() ? "" : printable(file) + ": ") + "RMSE " +
                                        percent(check->rmse) + " (at least " +
                                        percent(check->rmse_low) + ") is above --max-rmse " +
                                        shown_number(*options.max_rmse) +
                                        ": bake with a smaller --error or more --cells");
}

}  // namespace brume
