#include "pipeline/run/progress_text.h"

#include <gmock/gmock.h>

namespace q3d::pipeline::run {
namespace {

using ::testing::AllOf;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

ProgressState half() {
  ProgressState state;
  state.what = "candidates";
  state.done = 50;
  state.total = 100;
  state.per_second = 2.5;
  state.elapsed_s = 20.0;
  state.details = "retained 20, failed 30";
  return state;
}

TEST(ProgressLine, TellsTheTimeLeftAndInTheEndTheTimeTaken) {
  ProgressState state = half();
  EXPECT_EQ(progress_line(state), "candidates: 50 / 100 (50 %), 2.5/s, 20 s left; retained 20, failed 30");
  state.is_last = true;
  state.details.clear();
  EXPECT_EQ(progress_line(state), "candidates: 50 / 100 (50 %), 2.5/s, 20 s");
  state.per_second = 0.0;
  EXPECT_EQ(progress_line(state), "candidates: 50 / 100 (50 %), 20 s");
}

TEST(ProgressLine, NothingToDoIsAllDone) {
  EXPECT_EQ(progress_line({.what = "pictures"}), "pictures: 0 / 0 (100 %)");
}

TEST(ProgressBar, IsFilledByTheShareThatIsDone) {
  const std::string bar = progress_bar(half(), 120, false);
  EXPECT_EQ(bar,
            "candidates [############............] 50 %  50/100  2.5/s  20 s left  retained 20, failed 30");
  ProgressState state = half();
  state.done = 0;
  EXPECT_THAT(progress_bar(state, 120, false), HasSubstr("[........................] 0 %"));
  state.done = 99;  // it is full only in the end
  EXPECT_THAT(progress_bar(state, 120, false), HasSubstr("[#######################.] 99 %"));
  state.done = 100;
  EXPECT_THAT(progress_bar(state, 120, false), HasSubstr("[########################] 100 %"));
}

TEST(ProgressBar, FitsIntoTheTerminal) {
  for (int columns = 1; columns < 130; ++columns) {
    const std::string bar = progress_bar(half(), columns, false);
    // Below the width of name and shortest bar nothing more can be cut.
    EXPECT_LT(bar.size(), std::max<std::size_t>(static_cast<std::size_t>(columns), 21)) << columns;
  }
  EXPECT_THAT(progress_bar(half(), 80, false), AllOf(StartsWith("candidates [####"), HasSubstr("20 s left")));
  EXPECT_THAT(progress_bar(half(), 60, false), Not(EndsWith("failed 30")));
}

TEST(ProgressBar, OnlyTheFilledPartHasAColour) {
  const std::string bar = progress_bar(half(), 120, true);
  EXPECT_THAT(bar, StartsWith("candidates [\033[34m############\033[0m............] 50 %"));
  EXPECT_EQ(bar.size(), progress_bar(half(), 120, false).size() + std::string("\033[34m\033[0m").size());
}

TEST(HumanDuration, HasTwoUnitsAtMost) {
  EXPECT_EQ(human_duration(41.2), "41 s");
  EXPECT_EQ(human_duration(725), "12 min 05 s");
  EXPECT_EQ(human_duration(12000), "3 h 20 min");
}

}  // namespace
}  // namespace q3d::pipeline::run
