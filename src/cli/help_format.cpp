#include "cli/help_format.h"

#include <memory>

namespace brume {
namespace {

constexpr std::size_t kNameColumn = 32, kLineWidth = 96;

// `text` with lines no longer than `width`; lines after the first begin with `indent` blanks.
std::string wrapped(const std::string& text, std::size_t indent, std::size_t width) {
  std::string result, word;
  std::size_t length = 0;
  const auto flush = [&] {
    if (word.empty()) return;
    if (length > 0 && length + 1 + word.size() > width) {
      result += '\n' + std::string(indent, ' ');
      length = 0;
    }
    if (length > 0) result += ' ', ++length;
    result += word;
    length += word.size();
    word.clear();
  };
  for (const char c : text) {
    if (c == ' ')
      flush();
    else
      word += c;
  }
  flush();
  return result;
}

std::string entry(const std::string& name, const std::string& text) {
  std::string line = "  " + name;
  if (line.size() + 1 >= kNameColumn)
    line += '\n' + std::string(kNameColumn, ' ');
  else
    line.resize(kNameColumn, ' ');
  return line + wrapped(text, kNameColumn, kLineWidth - kNameColumn) + '\n';
}

class HelpFormat : public CLI::Formatter {
 public:
  std::string make_option(const CLI::Option* option, bool is_positional) const override {
    std::string name = option->get_name(is_positional, !is_positional);
    if (!is_positional && option->get_expected_max() > 0 && !option->get_type_name().empty() &&
        option->get_type_size_max() > 0)
      name += ' ' + option->get_type_name();
    const bool is_needed = option->get_required() && !is_positional;
    return entry(name, option->get_description() + (is_needed ? " (required)" : ""));
  }

  std::string make_subcommand(const CLI::App* verb) const override {
    return entry(verb->get_name(), verb->get_description());
  }

  std::string make_footer(const CLI::App* app) const override {
    std::string footer = app->get_footer();
    if (app->get_parent() != nullptr)
      footer +=
          std::string(footer.empty() ? "" : "\n\n") +
          "Any verb also takes -t, -q, -v, --progress, --json and --stats: see `brume --help`.";
    return footer + '\n';
  }
};

void append_verb(const CLI::App& verb, std::string& page) {
  page += "## " + full_name(verb) + "\n\n```text\n" + help_text(verb) + "```\n\n";
  for (const CLI::App* inner : verb.get_subcommands([](const CLI::App*) { return true; }))
    append_verb(*inner, page);
}

}  // namespace

void use_help_format(CLI::App& app) {
  const auto format = std::make_shared<HelpFormat>();
  format->label("SUBCOMMAND", "VERB");
  app.formatter(format);
}

std::string full_name(const CLI::App& verb) {
  std::string name = verb.get_name();
  for (const CLI::App* parent = verb.get_parent(); parent != nullptr; parent = parent->get_parent())
    name = parent->get_name() + ' ' + name;
  return name;
}

// Not App::help(), which speaks of the verb that was parsed, whomever one asks.
std::string help_text(const CLI::App& verb) {
  std::string text =
      verb.get_formatter()->make_help(&verb, full_name(verb), CLI::AppFormatMode::Normal);
  // CLI11 ends a group with one blank line and begins the next with another.
  for (std::size_t at; (at = text.find("\n\n\n")) != std::string::npos;) text.erase(at, 1);
  return text;
}

std::string help_as_markdown(const CLI::App& app) {
  std::string page =
      "# The command line of brume\n\n"
      "This page is what the program says of itself: `brume help --markdown`. A test compares the "
      "two.\n\n```text\n" +
      help_text(app) + "```\n\n";
  for (const CLI::App* verb : app.get_subcommands([](const CLI::App*) { return true; }))
    append_verb(*verb, page);
  page.pop_back();
  return page;
}

}  // namespace brume
