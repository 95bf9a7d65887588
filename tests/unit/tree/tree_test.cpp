// What the compiler does not hold the tree to: which folder may include what, and that builds list
// their sources.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <sstream>
#include <string>
#include <vector>

namespace brume {
namespace {

namespace fs = std::filesystem;

struct SourceFile {
  std::string path;  // From the top of the tree, with '/'.
  std::string text;

  std::string extension() const { return fs::path(path).extension().string(); }
  bool is_header() const { return extension() == ".h"; }
  bool is_code() const { return is_header() || extension() == ".cpp"; }
  bool is_under(const std::string& folder) const { return path.rfind(folder + "/", 0) == 0; }
  std::vector<std::string> lines() const {
    std::vector<std::string> all;
    std::istringstream in(text);
    for (std::string line; std::getline(in, line);) all.push_back(line);
    return all;
  }
  // What stands between the quotes or angle brackets of each #include.
  std::vector<std::string> includes() const {
    std::vector<std::string> all;
    for (const std::string& line : lines()) {
      const std::size_t begin = line.find_first_of("\"<");
      if (line.rfind("#include", 0) != 0 || begin == std::string::npos) continue;
      all.push_back(line.substr(begin + 1, line.find_first_of("\">", begin + 1) - begin - 1));
    }
    return all;
  }
};

std::string read(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  EXPECT_TRUE(in) << file;
  return {std::istreambuf_iterator<char>(in), {}};
}

// All text that is kept under version control, and nothing that was built.
const std::vector<SourceFile>& tree() {
  static const std::vector<SourceFile> all = [] {
    std::vector<SourceFile> files;
    const std::set<std::string> kinds{".h",    ".cpp", ".txt", ".cmake", ".in",
                                      ".json", ".md",  ".sh",  ".py",    ""};
    const fs::path top = BRUME_SOURCE_DIR;
    for (fs::recursive_directory_iterator i(top), end; i != end; ++i) {
      const std::string path = i->path().lexically_relative(top).generic_string();
      const std::string first = path.substr(0, path.find('/'));
      if (i->is_directory() &&
          (first == ".git" || first == "out" || first.rfind("build", 0) == 0)) {
        i.disable_recursion_pending();
      } else if (i->is_regular_file() && kinds.count(i->path().extension().string()) != 0) {
        files.push_back({path, read(i->path())});
      }
    }
    std::sort(files.begin(), files.end(),
              [](const auto& a, const auto& b) { return a.path < b.path; });
    return files;
  }();
  return all;
}

// The folder whose arrows a file obeys: "core", "vdb_media", "data_gen", "tools", "tests" ...
std::string module_of(const SourceFile& file) {
  const std::string path = file.is_under("src") ? file.path.substr(4) : file.path;
  return path.substr(0, path.find('/'));
}

TEST(Tree, HasTheFoldersTheseTestsLookAt) {
  std::set<std::string> modules;
  for (const SourceFile& file : tree())
    if (file.is_code()) modules.insert(module_of(file));
  for (const char* module :
       {"core", "vdb_media", "geom", "cache", "scene", "tools", "data_gen", "tests"})
    EXPECT_EQ(modules.count(module), 1u) << module;
}

// A library and the only places that may include its headers.
struct Border {
  std::vector<std::string> include_prefixes;
  std::vector<std::string> allowed;  // Path prefixes.
};

TEST(Tree, KeepsEachOutsideLibraryBehindItsBorder) {
  const std::vector<Border> borders{
      {{"openvdb/"}, {"vdb_media/src/", "tests/"}},
      {{"nanovdb/"}, {"tests/"}},
      {{"embree3/", "embree4/"}, {"src/geom/", "tests/bench/"}},
      {{"OpenImageIO/"}, {"src/core/image_file.cpp"}},
      {{"CLI/"}, {"src/cli/", "data_gen/main.cpp", "tests/unit/cli/"}},
      {{"assimp/"}, {"src/scene/", "tests/unit/exchange/"}},
  };
  const auto starts_with_any = [](const std::string& text,
                                  const std::vector<std::string>& prefixes) {
    return std::any_of(prefixes.begin(), prefixes.end(),
                       [&](const std::string& p) { return text.rfind(p, 0) == 0; });
  };
  std::size_t seen = 0;
  for (const SourceFile& file : tree()) {
    if (!file.is_code()) continue;
    for (const std::string& include : file.includes())
      for (const Border& border : borders) {
        if (!starts_with_any(include, border.include_prefixes)) continue;
        ++seen;
        EXPECT_TRUE(starts_with_any(file.path, border.allowed))
            << file.path << " includes " << include;
      }
  }
  EXPECT_GT(seen, 0u);
}

// They cost many seconds for every file that reads them.
TEST(Tree, HasNoHeaderThatIncludesOpenVdb) {
  for (const SourceFile& file : tree()) {
    if (!file.is_header()) continue;
    for (const std::string& include : file.includes())
      EXPECT_FALSE(include.rfind("openvdb/", 0) == 0 || include.rfind("nanovdb/", 0) == 0)
          << file.path << " includes " << include;
  }
}

TEST(Tree, HasArrowsThatNeverTurnRound) {
  // What each folder may include directly; what those may include, it may too.
  const std::map<std::string, std::set<std::string>> direct{
      {"core", {}},
      {"vdb_media", {"core"}},
      {"geom", {"core"}},
      {"cache", {"geom"}},
      {"exchange", {"cache", "vdb_media"}},
      {"scene", {"vdb_media", "geom"}},
      {"plan", {"scene"}},
      {"gather", {"plan", "cache"}},
      {"bake", {"gather"}},
      {"render", {"bake"}},
      {"study", {"render", "data_gen"}},
      {"cli", {"study", "exchange"}},
      {"data_gen", {"scene"}},
  };
  std::map<std::string, std::set<std::string>> allowed;
  const auto closure = [&](const auto& self, const std::string& module) -> std::set<std::string> {
    std::set<std::string> all{module};
    for (const std::string& next : direct.at(module)) all.merge(self(self, next));
    return all;
  };
  for (const auto& [module, unused] : direct) allowed[module] = closure(closure, module);

  for (const SourceFile& file : tree()) {
    const std::string module = module_of(file);
    if (!file.is_code() || file.is_under("tests") || file.is_under("tools")) continue;
    ASSERT_EQ(allowed.count(module), 1u) << file.path << ": a folder without arrows";
    for (const std::string& include : file.includes()) {
      const std::string target = include.substr(0, include.find('/'));
      if (include.find('/') == std::string::npos || direct.count(target) == 0) continue;
      EXPECT_EQ(allowed[module].count(target), 1u) << file.path << " includes " << include;
    }
  }
}

TEST(Tree, GathersKnowNothingOfDisks) {
  for (const SourceFile& file : tree()) {
    if (!file.is_code() || !file.is_under("src/gather")) continue;
    for (const std::string& include : file.includes())
      EXPECT_NE(include, "cache/cache_file.h") << file.path;
  }
}

TEST(Tree, ListsEverySourceInItsBuild) {
  std::map<std::string, std::string> builds;
  for (const SourceFile& file : tree())
    if (fs::path(file.path).filename() == "CMakeLists.txt")
      builds[fs::path(file.path).parent_path().generic_string()] = file.text;
  for (const SourceFile& file : tree()) {
    if (file.extension() != ".cpp") continue;
    fs::path folder = fs::path(file.path).parent_path();
    while (!folder.empty() && builds.count(folder.generic_string()) == 0)
      folder = folder.parent_path();
    const std::string listed = fs::path(file.path).lexically_relative(folder).generic_string();
    const std::string& text = builds[folder.generic_string()];
    // A whole word, so that a_test.cpp does not stand for test.cpp.
    bool found = false;
    for (std::size_t at = text.find(listed); at != std::string::npos && !found;
         at = text.find(listed, at + 1))
      found = at > 0 && std::string(" \n\t(\"/").find(text[at - 1]) != std::string::npos;
    EXPECT_TRUE(found) << file.path << " is in no CMakeLists.txt";
  }
  for (const auto& [folder, text] : builds) {
    EXPECT_EQ(text.find("GLOB"), std::string::npos) << folder << "/CMakeLists.txt";
    EXPECT_EQ(text.find("aux_source_directory"), std::string::npos) << folder << "/CMakeLists.txt";
  }
}

TEST(Tree, OpensEachHeaderWithWhatItIsFor) {
  for (const SourceFile& file : tree()) {
    if (!file.is_header()) continue;
    EXPECT_EQ(file.text.rfind("//", 0), 0u) << file.path;
    // Kernels' headers are read once for each instruction set.
    const bool is_kernel = file.path.ends_with("-inl.h");
    const char* guard = is_kernel ? "defined(HWY_TARGET_TOGGLE)\n" : "\n#pragma once\n";
    EXPECT_NE(file.text.find(guard), std::string::npos) << file.path;
  }
}

TEST(Tree, HasAnIndexOfItsDecisions) {
  const auto index = std::find_if(tree().begin(), tree().end(), [](const SourceFile& file) {
    return file.path == "docs/decisions/README.md";
  });
  ASSERT_NE(index, tree().end());
  for (const SourceFile& file : tree()) {
    if (!file.is_under("docs/decisions") || &file == &*index) continue;
    EXPECT_NE(index->text.find("(" + fs::path(file.path).filename().string() + ")"),
              std::string::npos)
        << file.path << " is not in the index";
  }
}

// Commands and folders that have been renamed are worse than none.
TEST(Tree, HasTheFilesItsReadmeLinksTo) {
  const std::string readme = read(fs::path(BRUME_SOURCE_DIR) / "README.md");
  std::size_t links = 0;
  for (std::size_t at = readme.find("]("); at != std::string::npos;
       at = readme.find("](", at + 1)) {
    const std::string target = readme.substr(at + 2, readme.find(')', at) - at - 2);
    if (target.find("://") != std::string::npos) continue;
    ++links;
    EXPECT_TRUE(fs::exists(fs::path(BRUME_SOURCE_DIR) / target)) << target;
  }
  EXPECT_GT(links, 0u);
}

TEST(Tree, NamesNoFolderOfOneMachine) {
  for (const SourceFile& file : tree())
    for (const std::string& line : file.lines())
      for (const std::string folder : {"work", "tmp", "farm", "home", "root"})
        EXPECT_EQ(line.find("/" + folder + "/"), std::string::npos) << file.path << ": " << line;
}

}  // namespace
}  // namespace brume
