#include <cstdlib>

#include "scene/input_file.h"
#include "scene/scene_load.h"

namespace brume {
namespace {

// Linux refuses longer ones; so do we, before they reach a message.
constexpr std::size_t kMaxPath = 4096;

std::string expand_environment(const SceneLoad& load, const std::string& pointer,
                               const std::string& text) {
  std::string out;
  std::size_t at = 0;
  while (at < text.size()) {
    const std::size_t open = text.find("${", at);
    out += text.substr(at, open - at);
    if (open == std::string::npos) break;
    const std::size_t close = text.find('}', open);
    if (close == std::string::npos)
      load.document.fail(pointer, "${ without its }", "write ${NAME}");
    const std::string name = text.substr(open + 2, close - open - 2);
    const char* value = std::getenv(name.c_str());
    if (!value)
      load.document.fail(pointer, "the environment has no " + printable(name),
                         "set it, or write the path out");
    out += value;
    at = close + 1;
  }
  return out;
}

// Runs of # stand for the frame number, padded with zeros to their length.
std::string expand_frame(SceneLoad& load, const std::string& pointer, const std::string& text,
                         bool is_input) {
  std::string out;
  std::size_t at = 0;
  while (at < text.size()) {
    const std::size_t first = text.find("##", at);
    out += text.substr(at, first - at);
    if (first == std::string::npos) break;
    const std::size_t end = std::min(text.find_first_not_of('#', first), text.size());
    if (!load.options.frame)
      load.document.fail(pointer,
                         "the name holds a frame number (" + text.substr(first, end - first) +
                             ") and no frame is chosen",
                         "add --frame N");
    const std::string digits = std::to_string(std::abs(*load.options.frame));
    const std::size_t sign = *load.options.frame < 0 ? 1 : 0;
    if (sign) out += '-';
    if (digits.size() + sign < end - first) out.append(end - first - digits.size() - sign, '0');
    out += digits;
    if (is_input) load.has_frame_numbers = true;
    at = end;
  }
  return out;
}

}  // namespace

std::filesystem::path resolve_path(SceneLoad& load, const std::string& pointer,
                                   const std::string& text, bool is_input) {
  if (text.empty()) load.document.fail(pointer, "the path is empty", "name a file");
  if (text.find('\0') != std::string::npos)
    load.document.fail(pointer, "the path holds a NUL character", "remove it");
  if (text.compare(0, 5, "file:") == 0 || text.find("://") != std::string::npos)
    load.document.fail(pointer, "\"" + printable(text, 80) + "\" is a URL", "give a plain path");
  std::string expanded = expand_environment(load, pointer, text);
  expanded = expand_frame(load, pointer, expanded, is_input);
  if (expanded.size() > kMaxPath)
    load.document.fail(pointer, "the path is " + std::to_string(expanded.size()) + " bytes long",
                       "at most " + std::to_string(kMaxPath) + " are possible");
  const auto path = (load.folder / expanded).lexically_normal();
  at_place(load.document, pointer, [&] {
    check_confined(path, load.options.confine);
    if (is_input && load.options.load_data) check_regular_file(path);
  });
  return path;
}

}  // namespace brume
