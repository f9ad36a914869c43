#include "manifests/own_process.h"

#include <gmock/gmock.h>
#include <unistd.h>

#include <csignal>
#include <stdexcept>

namespace q3d::manifests {
namespace {

using std::chrono::seconds;
using testing::HasSubstr;

std::string refusal_of(const std::function<std::string()>& work, seconds limit = seconds(60)) {
  try {
    in_own_process(work, limit);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "nothing was thrown";
}

TEST(OwnProcess, GivesWhatTheWorkReturnsHoweverLong) {
  EXPECT_EQ(in_own_process([] { return std::string(); }, seconds(60)), "");
  const std::string bytes = std::string(std::size_t{3} << 20U, 'x') + '\0' + "end";
  EXPECT_EQ(in_own_process([&bytes] { return bytes; }, seconds(60)), bytes);
}

TEST(OwnProcess, IsAnotherOne) {
  const std::string own = std::to_string(getpid());
  EXPECT_NE(in_own_process([] { return std::to_string(getpid()); }, seconds(60)), own);
}

TEST(OwnProcess, PassesOnWhatTheWorkThrows) {
  EXPECT_EQ(refusal_of([]() -> std::string { throw std::runtime_error("column 3: got 4, expected 5"); }),
            "column 3: got 4, expected 5");
}

TEST(OwnProcess, OutlivesACrash) {
  for (const int signal : {SIGSEGV, SIGABRT, SIGKILL}) {
    EXPECT_THAT(refusal_of([signal] { return raise(signal), std::string("alive"); }), HasSubstr("crashed"));
  }
}

TEST(OwnProcess, OutlivesAnExit) {
  EXPECT_THAT(refusal_of([]() -> std::string { _exit(3); }), HasSubstr("status 3"));
}

TEST(OwnProcess, EndsWorkThatHangs) {
  EXPECT_THAT(refusal_of([]() -> std::string { return pause(), std::string("awake"); }, seconds(1)),
              HasSubstr("more than 1 s"));
}

TEST(OwnProcess, ATrialTellsOnlyOfCrashes) {
  EXPECT_EQ(trial_in_own_process([] {}, seconds(60)), std::nullopt);
  EXPECT_EQ(trial_in_own_process([] { throw std::runtime_error("got 4, expected 5"); }, seconds(60)),
            std::nullopt);
  EXPECT_THAT(trial_in_own_process([] { raise(SIGSEGV); }, seconds(60)).value_or(""), HasSubstr("crashed"));
  EXPECT_THAT(trial_in_own_process([] { pause(); }, seconds(1)).value_or(""), HasSubstr("more than 1 s"));
  EXPECT_THAT(trial_in_own_process([] { _exit(0); }, seconds(60)).value_or(""), HasSubstr("gave no answer"));
}

}  // namespace
}  // namespace q3d::manifests
