#include "grid_names.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"

namespace brume {
namespace {

using testing::HasSubstr;

std::vector<GridEntry> entries(std::initializer_list<const char*> names,
                               const std::string& type = "float") {
  std::vector<GridEntry> list;
  for (const char* name : names) list.push_back({name, type, false});
  return list;
}

std::optional<std::size_t> choose(const std::vector<GridEntry>& list, GridRequest request) {
  return choose_grid("f.vdb", list, request);
}

std::string refusal(const std::vector<GridEntry>& list, const GridRequest& request) {
  try {
    choose(list, request);
  } catch (const Error& e) {
    EXPECT_EQ(e.kind(), ErrorKind::InvalidInput);
    return e.what();
  }
  return "not refused";
}

TEST(GridNames, EachRoleKnowsItsAliasesWhateverTheirCase) {
  const std::vector<std::pair<GridRole, std::vector<const char*>>> kNames{
      {GridRole::Density, {"density", "dens", "Density", "DENS"}},
      {GridRole::Temperature, {"temperature", "temp", "heat", "Heat"}},
      {GridRole::Flame, {"flame", "flames", "burn", "FLAMES"}},
      {GridRole::Emission, {"emission", "Emission"}},
      {GridRole::Color, {"Cd", "color", "albedo", "cd", "Albedo"}}};
  for (const auto& [role, names] : kNames)
    for (const char* name : names) {
      EXPECT_EQ(choose(entries({"other", name}), {role, std::nullopt, true}), 1u) << name;
      EXPECT_EQ(usual_role(name), role) << name;
    }
}

TEST(GridNames, EarlierAliasesWin) {
  EXPECT_EQ(choose(entries({"dens", "density"}), {}), 1u);
  EXPECT_EQ(choose(entries({"heat", "temp"}), {GridRole::Temperature, std::nullopt, true}), 1u);
}

TEST(GridNames, TheExactSpellingWinsOverOthers) {
  EXPECT_EQ(choose(entries({"Density", "density"}), {}), 1u);
}

TEST(GridNames, AnOverrideWinsOverTheUsualName) {
  EXPECT_EQ(choose(entries({"density", "ash"}), {GridRole::Density, "ash", true}), 1u);
  EXPECT_EQ(choose(entries({"density", "Ash"}), {GridRole::Density, "ash", true}), 1u);
}

TEST(GridNames, TwoOfOneNameAreAnErrorThatNamesThePlaces) {
  const auto list = entries({"density", "density", "density"});
  EXPECT_THAT(refusal(list, {}), HasSubstr("density[0], density[1], density[2]"));
  EXPECT_EQ(choose(list, {GridRole::Density, "density[2]", true}), 2u);
  EXPECT_THAT(refusal(list, {GridRole::Density, "density", true}), HasSubstr("3 grids"));
  EXPECT_THAT(refusal(list, {GridRole::Density, "density[3]", true}), HasSubstr("not in the file"));
}

TEST(GridNames, ANameThatHoldsBracketsIsTakenAsItIs) {
  EXPECT_EQ(choose(entries({"a", "a[0]"}), {GridRole::Density, "a[0]", true}), 1u);
  EXPECT_EQ(choose(entries({"b", "a"}), {GridRole::Density, "a[0]", true}), 1u);
  EXPECT_THAT(refusal(entries({"a"}), {GridRole::Density, "a[]", true}), HasSubstr("a[]"));
  EXPECT_THAT(refusal(entries({"a"}), {GridRole::Density, "a[-1]", true}), HasSubstr("a[-1]"));
  EXPECT_THAT(refusal(entries({"a"}), {GridRole::Density, "a[99999999999999999999]", true}),
              HasSubstr("not in the file"));
}

TEST(GridNames, AnUnusualNameIsListedWithTheWayToMapIt) {
  const std::string text = refusal(entries({"voxel_fog_density"}), {});
  EXPECT_THAT(text, HasSubstr("voxel_fog_density (float)"));
  EXPECT_THAT(text, HasSubstr("\"grids\": {\"density\": \"voxel_fog_density\"}"));
}

TEST(GridNames, AnOptionalGridMayBeMissing) {
  EXPECT_EQ(choose(entries({"density"}), {GridRole::Temperature, std::nullopt, false}),
            std::nullopt);
  EXPECT_EQ(choose(entries({"density"}), {GridRole::Temperature, "t", false}), std::nullopt);
}

TEST(GridNames, HostileNamesAreShownEscaped) {
  const std::string text = refusal(entries({"a\x1b[31m\nb"}), {});
  EXPECT_THAT(text, HasSubstr("a\\x1b[31m\\x0ab"));
  EXPECT_EQ(text.find('\n'), std::string::npos);
}

TEST(GridNames, LongListsAreCut) {
  std::vector<GridEntry> list(40, GridEntry{"x", "float", false});
  EXPECT_THAT(refusal(list, {}), HasSubstr("and 28 more"));
}

TEST(GridNames, OnlyVectorsOfTheUsualNamesAreVelocities) {
  EXPECT_TRUE(is_velocity({"vel", "vec3s", false}));
  EXPECT_TRUE(is_velocity({"V", "vec3d", false}));
  EXPECT_FALSE(is_velocity({"vel", "float", false}));
  EXPECT_FALSE(is_velocity({"Cd", "vec3s", false}));
}

}  // namespace
}  // namespace brume
