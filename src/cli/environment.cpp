#include "cli/environment.h"

#include <unistd.h>

#include <cstdlib>
#include <set>

#include "cli/nearest_name.h"
#include "core/error.h"

namespace brume {
namespace {

constexpr std::string_view kPrefix = "BRUME_";

void warn_of_unknown_variables(const CommandContext& context, const std::set<std::string>& known) {
  const std::vector<std::string> names(known.begin(), known.end());
  for (char** entry = environ; entry && *entry; ++entry) {
    const std::string_view text(*entry);
    if (!text.starts_with(kPrefix)) continue;
    const std::string name(text.substr(0, text.find('=')));
    if (!known.contains(name))
      context.warn(printable(name) + ": unknown variable, ignored" + hint_for(name, names));
  }
}

}  // namespace

std::string environment_name(const CLI::Option& option) {
  std::string name(kPrefix);
  for (const char c : option.get_lnames().at(0))
    name += c == '-' ? '_' : static_cast<char>(c >= 'a' && c <= 'z' ? c - 'a' + 'A' : c);
  return name;
}

CLI::Option* with_environment(CommandContext& context, CLI::App& app, CLI::Option* option) {
  context.environment_options.emplace_back(&app, option);
  return option;
}

void apply_environment(CommandContext& context) {
  std::set<std::string> known;
  for (const auto& [app, option] : context.environment_options) {
    const std::string name = environment_name(*option);
    known.insert(name);
    const char* value = std::getenv(name.c_str());
    const bool in_use = app->get_parent() == nullptr || app->parsed();
    if (!value || !*value || !in_use || option->count() > 0) continue;
    try {
      option->add_result(value);
      option->run_callback();
    } catch (const CLI::ParseError& error) {
      throw Error(ErrorKind::Usage, name + " (in the environment): " + error.what());
    }
  }
  warn_of_unknown_variables(context, known);
}

}  // namespace brume
