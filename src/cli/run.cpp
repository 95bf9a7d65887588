#include "cli/run.h"

#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <iostream>
#include <new>

#include "cli/commands.h"
#include "cli/diff_command.h"
#include "cli/environment.h"
#include "cli/help_format.h"
#include "cli/nearest_name.h"
#include "cli/scene_commands.h"
#include "cli/values.h"
#include "cli/version.h"
#include "core/error.h"
#include "core/parallel.h"

namespace brume {
namespace {

constexpr int kUsageExit = 2;
constexpr int kMaxThreads = 4096;

std::vector<const CLI::App*> verbs_of(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App*) { return true; });
}

// The verb that was parsed, down to `scene check`.
const CLI::App& parsed_verb(const CLI::App& app) {
  const CLI::App* verb = &app;
  while (!verb->get_subcommands().empty()) verb = verb->get_subcommands().front();
  return *verb;
}

std::vector<std::string> verb_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* verb : verbs_of(app)) names.push_back(verb->get_name());
  return names;
}

// Long flags that `verb` understands, its parents' included.
std::vector<std::string> flag_names(const CLI::App& verb) {
  std::vector<std::string> names;
  for (const CLI::App* app = &verb; app != nullptr; app = app->get_parent())
    for (const CLI::Option* option : app->get_options())
      for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  return names;
}

std::string shown_list(const std::vector<std::string>& names) {
  std::string list;
  for (const std::string& name : names) list += (list.empty() ? "" : ", ") + name;
  return list;
}

// What to say of an argument that no option and no verb took.
std::string unknown_argument(const CLI::App& app, const std::string& argument) {
  const CLI::App& verb = parsed_verb(app);
  if (argument.size() > 1 && argument[0] == '-') {
    const std::string flag = argument.substr(0, argument.find('='));
    return "unknown option '" + printable(flag) + "'" + hint_for(flag, flag_names(verb)) +
           ": see `" + full_name(verb) + " --help`";
  }
  const auto inner = verb_names(verb);
  if (!inner.empty())
    return "unknown verb '" + printable(argument) + "'" + hint_for(argument, inner) +
           ": choose from " + shown_list(inner);
  return "unexpected argument '" + printable(argument) + "': see `" + full_name(verb) + " --help`";
}

std::string one_line(std::string text) {
  while (!text.empty() && text.back() == '\n') text.pop_back();
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text;
}

void print_error(const CommandContext& context, const std::string& message) {
  context.err << (context.color ? "\x1b[31merror:\x1b[0m " : "error: ") << one_line(message) << '\n'
              << std::flush;
}

void add_help_command(CLI::App& app, CommandContext& context) {
  CLI::App* verb = app.add_subcommand("help", "Explains a verb; the same as `brume VERB --help`");
  struct Options {
    std::string verb;
    bool is_markdown = false;
  };
  const auto options = std::make_shared<Options>();
  verb->add_option("VERB", options->verb, "Which one (default: the program)");
  verb->add_flag("--markdown", options->is_markdown, "Everything, as docs/cli.md");
  verb->callback([options, &app, &context] {
    context.action = [options, &app, &context] {
      if (options->is_markdown) {
        context.out << help_as_markdown(app);
        return 0;
      }
      if (options->verb.empty()) {
        context.out << help_text(app);
        return 0;
      }
      for (const CLI::App* candidate : verbs_of(app))
        if (candidate->get_name() == options->verb) {
          context.out << help_text(*candidate);
          return 0;
        }
      throw Error(ErrorKind::Usage, "unknown verb '" + printable(options->verb) + "'" +
                                        hint_for(options->verb, verb_names(app)) +
                                        ": choose from " + shown_list(verb_names(app)));
    };
  });
}

// Options of any verb, understood before and after it.
void add_global_options(CLI::App& app, CommandContext& context) {
  with_environment(context, app,
                   add_parsed(
                       app, "-t,--threads", "N", context.threads,
                       [](const std::string& option, const std::string& text) {
                         return static_cast<int>(parse_integer(option, text, 0, kMaxThreads));
                       },
                       "Threads; 0 (default): SLURM_CPUS_PER_TASK, else the CPUs there are"));
  app.add_flag_callback(
      "-q,--quiet", [&context] { context.verbosity = -1; }, "Only errors on standard error");
  app.add_flag_function(
      "-v,--verbose",
      [&context](std::int64_t times) { context.verbosity = static_cast<int>(times); },
      "Says more; -vv more yet");
  with_environment(
      context, app,
      add_parsed(
          app, "--progress", "auto|bar|plain|none", context.progress,
          [](const std::string& option, const std::string& text) {
            return parse_choice<ProgressStyle>(option, text,
                                               {{"auto", ProgressStyle::Auto},
                                                {"bar", ProgressStyle::Bar},
                                                {"plain", ProgressStyle::Plain},
                                                {"none", ProgressStyle::None}});
          },
          "On standard error; auto (default): a bar on a terminal, else now and then a line"));
  app.add_flag("--json", context.json, "The result as one JSON object on standard output");
  add_path(app, "--stats", context.stats_file, "FILE.json",
           "Also writes the run's statistics to this file");
}

void build(CLI::App& app, CommandContext& context) {
  app.set_help_flag("-h,--help", "Explains this verb");
  app.set_version_flag("--version", version_text(), "Names brume and its libraries");
  use_help_format(app);
  app.fallthrough();
  app.require_subcommand(0, 1);
  add_global_options(app, context);
  add_render_command(app, context);
  add_bake_command(app, context);
  add_inspect_command(app, context);
  add_verify_command(app, context);
  add_merge_command(app, context);
  add_figures_command(app, context);
  add_probe_command(app, context);
  add_diff_command(app, context);
  add_filter_command(app, context);
  add_convert_command(app, context);
  add_flicker_command(app, context);
  add_scene_commands(app, context);
  add_help_command(app, context);
  for (CLI::App* verb : app.get_subcommands([](CLI::App*) { return true; })) verb->group("Verbs");
  app.footer(
      R"(A setting comes from its flag, else from the environment (--step-voxels is BRUME_STEP_VOXELS), else
from the scene file. Results go to standard output, everything else to standard error. NO_COLOR is
respected.

Exit codes: 0 done; 1 internal error; 2 usage; 3 bad input or over a limit; 5 over a threshold; 6 out of
memory or disk, or cannot write; 75 stopped early, the same command goes on; 128+n ended by signal n.

Examples:
  brume render shot.json -o shot.exr --preview shot.png
  brume bake shot.json -o shot.irc
  brume inspect smoke.vdb)");
}

// Nothing where the verb's action is to be run; else the exit code.
std::optional<int> parse(CLI::App& app, CommandContext& context) {
  try {
    std::vector<std::string> reversed(context.arguments.rbegin(), context.arguments.rend());
    app.parse(std::move(reversed));
  } catch (const CLI::CallForHelp&) {
    context.out << help_text(parsed_verb(app));
    return 0;
  } catch (const CLI::CallForVersion&) {
    context.out << version_text();
    return 0;
  } catch (const CLI::ExtrasError&) {
    print_error(context, unknown_argument(app, app.remaining(true).front()));
    return kUsageExit;
  } catch (const CLI::RequiredError& error) {
    const CLI::App& verb = parsed_verb(app);
    // A flag that nobody knows often swallowed what is missing.
    const auto rest = app.remaining(true);
    print_error(context, rest.empty() ? full_name(verb) + ": " + error.what() + ": see `" +
                                            full_name(verb) + " --help`"
                                      : unknown_argument(app, rest.front()));
    return kUsageExit;
  } catch (const CLI::ParseError& error) {
    print_error(context, error.what());
    return kUsageExit;
  }
  return std::nullopt;
}

int run_verb(CLI::App& app, CommandContext& context) {
  if (const auto code = parse(app, context)) return *code;
  apply_environment(context);
  if (!context.action) {
    print_error(context, "no verb was given: choose from " + shown_list(verb_names(app)) +
                             ", or see `brume --help`");
    return kUsageExit;
  }
  const ThreadLimit limit(context.threads);
  return context.action();
}

}  // namespace

int run(const std::vector<std::string>& arguments, std::ostream& out, std::ostream& err) {
  CommandContext context{out, err, arguments};
  context.err_is_terminal = &err == &std::cerr && isatty(STDERR_FILENO);
  const char* no_color = std::getenv("NO_COLOR");
  context.color = context.err_is_terminal && (no_color == nullptr || *no_color == '\0');
  CLI::App app("Renders surfaces lit through smoke, dust and haze", "brume");
  build(app, context);
  try {
    const int code = run_verb(app, context);
    out.flush();
    if (!out) throw Error(ErrorKind::Resource, "standard output: cannot write");
    return code;
  } catch (const Error& error) {
    print_error(context, error.what());
    return exit_code(error.kind());
  } catch (const std::bad_alloc&) {
    print_error(context, "out of memory: use a smaller --res or scene");
    return exit_code(ErrorKind::Resource);
  } catch (const std::exception& error) {
    print_error(context, std::string("internal error: ") + error.what());
    return exit_code(ErrorKind::Internal);
  }
}

}  // namespace brume
