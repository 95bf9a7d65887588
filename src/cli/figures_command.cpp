// brume figures: the validation and result figures of the talk, from our own runs.
#include "cli/commands.h"
#include "cli/outputs.h"
#include "cli/progress.h"
#include "cli/signals.h"
#include "cli/stopping.h"
#include "cli/text_table.h"
#include "cli/values.h"
#include "core/error.h"
#include "data_gen/talk_scenes.h"
#include "study/chart_library.h"
#include "study/figure_page.h"

namespace brume {
namespace {

void print_errors(std::ostream& out, const std::string& title, const FiguresReport& report,
                  InterpolationErrors InterpolationStudy::*which) {
  std::vector<std::vector<std::string>> rows{{title, "records"}};
  for (const GradientMode mode : kGradientModes) rows[0].push_back(gradient_mode_name(mode));
  for (const FigureScene& s : report.scenes) {
    const InterpolationErrors& errors = s.interpolation.*which;
    rows.push_back({s.name, std::to_string(errors.records)});
    for (const double v : errors.relmse) rows.back().push_back(shown_number(v));
  }
  print_table(out, rows);
  out << '\n';
}

void print_report(std::ostream& out, const FiguresReport& report) {
  print_errors(out, "relMSE of interpolated irradiance", report, &InterpolationStudy::as_baked);
  print_errors(out, "a quarter of the records, twice the radius", report,
               &InterpolationStudy::sparse);
  std::vector<std::vector<std::string>> costs{
      {"CPU of a gather, full over ward-heckbert", "ratio", "low", "high"}};
  for (const FigureScene& s : report.scenes)
    costs.push_back(
        {s.name, shown_number(s.cost.ratio), shown_number(s.cost.low), shown_number(s.cost.high)});
  print_table(out, costs);
}

int figures(FiguresOptions options, const CommandContext& context) {
  // What could be missing shows now, not after the work.
  const std::string chart_library = load_chart_library(chart_library_folders());
  std::error_code error;
  std::filesystem::create_directories(options.folder, error);
  if (error)
    throw Error(ErrorKind::Resource, printable(options.folder.string()) +
                                         ": cannot make the folder: " + error.message() +
                                         ": choose one that can be written");
  check_writable(options.folder / "index.html");
  if (!context.stats_file.empty()) check_writable(context.stats_file);
  SignalWatch watch;
  Progress progress(context);
  StudyRun run;
  run.threads = context.threads;
  run.progress = progress.callback();
  run.stop_requested = SignalWatch::stop_requested;
  Statistics statistics;
  try {
    const FiguresReport report =
        statistics.timed("study", [&] { return study_figures(options, run); });
    progress.finish();
    statistics.timed("write", [&] { write_figures(report, options.folder, chart_library); });
    statistics.details["figures"] = figures_json(report);
    if (context.json)
      print_json(context, figures_json(report));
    else
      print_report(context.out, report);
  } catch (const Error& e) {
    if (e.kind() != ErrorKind::Stopped) throw;
    return end_stopped_run(context, SignalWatch::signal(), {});
  }
  CommandContext stats_alone = context;
  stats_alone.json = false;
  report_statistics(stats_alone, statistics);
  context.note(printable((options.folder / "index.html").string()) + ": written");
  return 0;
}

}  // namespace

void add_figures_command(CLI::App& app, CommandContext& context) {
  CLI::App* verb = app.add_subcommand(
      "figures", "Makes the validation and result figures of gradients, as a page");
  const auto options = std::make_shared<FiguresOptions>();
  add_path(*verb, "-o,--output", options->folder, "DIR",
           "Folder for index.html, figures.json, PNG files and the scenes")
      ->required();
  verb->add_flag("--quick", options->is_quick,
                 "Small, coarse and noisy, in a minute: shows that all of it works");
  add_parsed(
      *verb, "--size", "N", options->width_px,
      [](const std::string& option, const std::string& text) {
        return static_cast<int>(parse_integer(option, text, 16, 8192));
      },
      "Width of the rendered frames in pixels (default 1024, or 64 with --quick)");
  std::string names;
  for (const std::string& name : talk_scene_names()) names += (names.empty() ? "" : ", ") + name;
  add_parsed(
      *verb, "--only", "A,B,...", options->only,
      [](const std::string&, const std::string& text) { return parse_list(text); },
      "Scenes to show (default: all): " + names);
  verb->footer(
      R"(Each scene is generated, baked and gathered again with the gradients of every mode at the same records;
the page shows gradients, extrapolated irradiance, frames, their errors and times. It needs no network.
Without --quick it takes an hour or so.

Examples:
  brume figures -o out/figures --quick
  brume figures -o out/figures --only scattering,window --size 512
  brume figures -o out/figures --json > figures.json)");
  verb->callback([options, &context] {
    context.action = [options, &context] { return figures(*options, context); };
  });
}

}  // namespace brume
