#include "cli/scene_commands.h"

#include <array>
#include <memory>
#include <nlohmann/json.hpp>

#include "cli/scene_summary.h"
#include "cli/shared_options.h"
#include "scene/scene_file.h"

namespace brume {
namespace {

std::string counted(std::size_t n, const std::string& noun) {
  const bool is_es = noun.ends_with("sh");
  return std::to_string(n) + " " + noun + (n == 1 ? "" : is_es ? "es" : "s");
}

int check_scene(const SceneOptions& options, const CommandContext& context) {
  const Scene scene = load_scene_verbosely(options, context);
  const SceneSummary summary = summarize(scene);
  if (context.json) {
    const nlohmann::ordered_json json{
        {"file", options.file.string()}, {"ok", true}, {"warnings", scene.warnings}};
    context.out << json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) << '\n';
    return 0;
  }
  context.out << options.file.string() << ": OK: " << counted(summary.triangles, "triangle") << ", "
              << counted(scene.lights.size() + summary.mesh_lights, "light") << ", "
              << counted(scene.volumes.size(), "volume") << ", "
              << counted(scene.warnings.size(), "warning") << '\n';
  return 0;
}

int show_scene(const SceneOptions& options, const CommandContext& context) {
  const Scene scene = load_scene_verbosely(options, context);
  const nlohmann::ordered_json json = summary_json(scene);
  if (context.json)
    context.out << json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) << '\n';
  else
    write_summary_text(context.out, json);
  return 0;
}

}  // namespace

void add_scene_commands(CLI::App& app, CommandContext& context) {
  CLI::App* scene = app.add_subcommand("scene", "Check and show scene files");
  scene->require_subcommand(1);
  // The options live as long as the application: its parser writes to them.
  const auto add = [&](const char* name, const char* description,
                       int (*work)(const SceneOptions&, const CommandContext&)) {
    CLI::App* verb = scene->add_subcommand(name, description);
    auto options = std::make_shared<SceneOptions>();
    add_scene_options(*verb, context, *options);
    verb->callback([options, work, &context] {
      context.action = [options, work, &context] { return work(*options, context); };
    });
  };
  add("check", "Load a scene and everything it names; say what is wrong", check_scene);
  add("info", "What a scene holds: cameras, surfaces, lights, media, settings", show_scene);

  CLI::App* schema = scene->add_subcommand("schema", "Print the JSON Schema of scene files");
  auto as_page = std::make_shared<bool>(false);
  schema->add_flag("--markdown", *as_page, "Print the documentation page instead");
  schema->callback([as_page, &context] {
    context.action = [as_page, &context] {
      context.out << (*as_page ? scene_format_page() : scene_schema());
      return 0;
    };
  });
}

}  // namespace brume
