// The study of a piece of ground, on scenes of the talk made small.
#include "study/ground_study.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "core/error.h"
#include "data_gen/talk_scenes.h"
#include "scene/scene_file.h"
#include "support/scratch_folder.h"

namespace brume {
namespace {

std::size_t index_of(GradientSource source) { return static_cast<std::size_t>(source); }

Scene talk_scene(const std::string& name) {
  const ScratchFolder folder;  // CTest runs the tests of this file beside one another.
  TalkSceneOptions options;
  options.size_px = 32;
  options.resolution = 16;
  return load_scene(write_talk_scene(name, folder.path(), options).front(), {});
}

GroundOptions small() {
  GroundOptions options;
  options.area = talk_ground();
  options.pixels = 6;
  options.cells = 8;
  options.reference_cells = 10;
  options.line_at = 0.7;
  options.line_cells = 12;
  options.line_seeds = 4;
  options.records = 4;
  options.cell_counts = {8};
  options.record_counts = {2, 5};
  options.record_cells = 12;
  options.repeats = 1;
  return options;
}

GroundStudy study(const std::string& name, int threads = 2) {
  StudyRun run;
  run.threads = threads;
  const Scene loaded = talk_scene(name);
  const StudyScene scene(loaded, settings_of(loaded.render), run);
  return study_ground(scene, small(), run);
}

const GroundStudy& no_walls() {
  static const GroundStudy all = study("no-walls");
  return all;
}

TEST(GroundStudy, InTheOpenWardHeckbertSeesNothing) {
  const GroundStudy& s = no_walls();
  EXPECT_EQ(s.media_share, 1);
  for (const Vec2d& g : s.gradient[index_of(GradientSource::WardHeckbert)])
    EXPECT_EQ(g, Vec2d(0.0));
  EXPECT_DOUBLE_EQ(s.line.relative_error[index_of(GradientSource::WardHeckbert)],
                   std::sqrt(1 - std::pow(s.line.truth_relative_error, 2)));
}

TEST(GroundStudy, GradientsOfTheMediumFollowTheTruth) {
  const GroundStudy& s = no_walls();
  EXPECT_LT(s.line.truth_relative_error, 0.1);
  EXPECT_LT(s.line.relative_error[index_of(GradientSource::Full)], 0.35);
  EXPECT_LT(s.line.relative_error[index_of(GradientSource::FineDifferences)], 0.35);
}

TEST(GroundStudy, ExtrapolationIsBetterWithTheGradient) {
  const GroundStudy& s = no_walls();
  EXPECT_EQ(s.record_sites.size(), 16u);
  EXPECT_LT(s.extrapolation[3].relative_rms, 0.7 * s.extrapolation[0].relative_rms);
  EXPECT_EQ(s.extrapolation[1].relative_rms, s.extrapolation[0].relative_rms);
  ASSERT_EQ(s.by_records.size(), 2u);
  EXPECT_EQ(s.by_records[1].count, 25);
  EXPECT_LT(s.by_records[1].relative_rms[3], s.by_records[0].relative_rms[3]);
  ASSERT_EQ(s.by_cells.size(), 1u);
  EXPECT_EQ(s.by_cells[0].count, 8 * 25);
}

TEST(GroundStudy, LeavesOutWhatStandsOnTheGround) {
  const GroundStudy s = study("absorbing");
  const auto covered = std::count(s.is_ground.begin(), s.is_ground.end(), 0);
  EXPECT_GT(covered, 0);
  EXPECT_LT(covered, 9);
  for (std::size_t i = 0; i < s.is_ground.size(); ++i)
    EXPECT_TRUE(s.is_ground[i] || s.irradiance[i] == 0) << i;
  EXPECT_EQ(s.media_share, 0);  // It absorbs, and sends nothing.
}

TEST(GroundStudy, IsTheSameForAnyNumberOfThreads) {
  const GroundStudy one = study("no-walls", 1);
  const GroundStudy& two = no_walls();
  EXPECT_EQ(one.irradiance, two.irradiance);
  EXPECT_EQ(one.gradient, two.gradient);
  EXPECT_EQ(one.line.truth, two.line.truth);
  for (std::size_t m = 0; m < kModeCount; ++m)
    EXPECT_EQ(one.extrapolation[m].irradiance, two.extrapolation[m].irradiance);
}

TEST(GroundStudy, RefusesAreasWithoutGround) {
  StudyRun run;
  const Scene loaded = talk_scene("no-walls");
  const StudyScene scene(loaded, settings_of(loaded.render), run);
  GroundOptions options = small();
  options.area = {{-1, 1, -1}, {1, 1, 1}};
  EXPECT_THROW(study_ground(scene, options, run), Error);
}

}  // namespace
}  // namespace brume
