// What `--help` prints, and the same as a page of Markdown (docs/cli.md).
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace brume {

// Gives `app` and all verbs added later the house's layout: options by group, texts wrapped.
void use_help_format(CLI::App& app);

// "brume scene check", whichever way it was reached.
std::string full_name(const CLI::App& verb);

std::string help_text(const CLI::App& verb);

// Every verb's help, in the order they were added.
std::string help_as_markdown(const CLI::App& app);

}  // namespace brume
