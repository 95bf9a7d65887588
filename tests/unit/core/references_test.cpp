// Comments cite papers as [KEY]; docs/references.md lists the keys.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <regex>
#include <set>
#include <string>

namespace brume {
namespace {

namespace fs = std::filesystem;

std::string text_of(const fs::path& file) {
  std::ifstream in(file);
  return {std::istreambuf_iterator<char>(in), {}};
}

// Where each key is cited first. A citation is [KEY], [KEY, Eq. 3] or [KEY, OTHER].
std::map<std::string, std::string> cited_keys(const fs::path& root) {
  const std::regex bracket(R"(\[([A-Z][A-Za-z]+\*?[0-9]{2}[^\]\n]*)\])"), key(R"(\b[A-Z][A-Za-z]+\*?[0-9]{2}\b)");
  std::map<std::string, std::string> keys;
  for (const char* folder : {"src", "vdb_media", "data_gen", "tools", "tests"}) {
    if (!fs::exists(root / folder)) continue;
    for (const auto& entry : fs::recursive_directory_iterator(root / folder)) {
      const std::string type = entry.path().extension().string();
      if (type != ".h" && type != ".cpp") continue;
      const std::string text = text_of(entry.path());
      for (std::sregex_iterator b(text.begin(), text.end(), bracket), end; b != end; ++b) {
        const std::string inside = (*b)[1];
        for (std::sregex_iterator k(inside.begin(), inside.end(), key); k != end; ++k)
          keys.emplace(k->str(), entry.path().filename().string());
      }
    }
  }
  return keys;
}

TEST(References, EveryCitedKeyIsListedAndEveryListedKeyIsCited) {
  const fs::path root = BRUME_SOURCE_DIR;
  const std::string list = text_of(root / "docs/references.md");
  const std::regex row(R"(\n\| ([A-Z][A-Za-z]+\*?[0-9]{2}) \|)");
  std::set<std::string> listed;
  for (std::sregex_iterator r(list.begin(), list.end(), row), end; r != end; ++r) listed.insert((*r)[1]);
  const std::map<std::string, std::string> cited = cited_keys(root);
  EXPECT_GT(cited.size(), 10u);
  for (const auto& [key, file] : cited) EXPECT_TRUE(listed.count(key)) << key << ", cited in " << file;
  for (const std::string& key : listed) EXPECT_TRUE(cited.count(key)) << key << " is cited nowhere";
}

}  // namespace
}  // namespace brume
