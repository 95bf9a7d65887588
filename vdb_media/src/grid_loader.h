// What the two sides of the grid loader agree on besides the blob.
#pragma once

namespace brume {

// The private argument that turns a program into the loader child.
inline constexpr const char* kLoaderArgument = "--brume-grid-loader-child";
// The child's exit status where its limits could not be set, so that nothing was parsed.
inline constexpr int kLoaderNotSetUp = 70;

// Remembers that main() has offered to be the child; without that a copy of this program would run
// its main() instead of the loader.
void note_loader_entry();

}  // namespace brume
