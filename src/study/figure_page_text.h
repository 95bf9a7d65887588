// What the page of figures says and looks like, whatever the numbers; private to study.
#pragma once

#include <string>

namespace brume {

extern const char* const kPageStyle;   // CSS.
extern const char* const kPageScript;  // Draws the charts that the JSON element `charts` describes.
extern const char* const kPageIntroduction;         // HTML, like those that follow.
extern const char* const kPageInterpolation;        // Above the table of records as baked.
extern const char* const kPageSparseInterpolation;  // Above that of fewer ones.

struct SceneText {
  const char* title;
  const char* description;  // What is there, HTML.
  const char* shows;        // What to look for, HTML.
};
SceneText scene_text_of(const std::string& name);

}  // namespace brume
