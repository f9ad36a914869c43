// Several ranks, as processes of their own that meet over Gloo on this machine, against one.
#include <arpa/inet.h>
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <numeric>
#include <sstream>

#include "model/ranks/rank_place.h"
#include "smal/tensors/safetensors.h"
#include "tests/support/paths.h"

namespace q3d::model::ranks {
namespace {

using ::testing::HasSubstr;

int free_port() {
  const int server = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof(address);
  EXPECT_EQ(::bind(server, reinterpret_cast<sockaddr*>(&address), size), 0);
  EXPECT_EQ(::getsockname(server, reinterpret_cast<sockaddr*>(&address), &size), 0);
  ::close(server);
  return ntohs(address.sin_port);
}

class Ranks : public ::testing::Test {
 protected:
  struct Ended {
    int status = -1;
    std::string message;
  };

  // Starts some of `size` ranks, and waits for them.
  std::vector<Ended> launch(const std::string& mode, int size, const std::vector<int>& ranks) const {
    const std::string port = std::to_string(free_port());
    std::vector<pid_t> processes;
    for (const int rank : ranks) {
      processes.push_back(
          start(mode, rank,
                {"RANK=" + std::to_string(rank), "WORLD_SIZE=" + std::to_string(size),
                 "LOCAL_RANK=" + std::to_string(rank), "LOCAL_WORLD_SIZE=" + std::to_string(size),
                 "MASTER_ADDR=127.0.0.1", "MASTER_PORT=" + port, "GLOO_SOCKET_IFNAME=lo"}));
    }
    std::vector<Ended> all;
    for (std::size_t i = 0; i < processes.size(); ++i) {
      Ended& ended = all.emplace_back();
      int status = 0;
      ::waitpid(processes[i], &status, 0);
      if (WIFEXITED(status)) ended.status = WEXITSTATUS(status);
      std::ifstream stream(errors(mode, ranks[i]));
      ended.message = (std::ostringstream() << stream.rdbuf()).str();
    }
    return all;
  }

  // Reads what each rank wrote.
  std::vector<smal::tensors::SafeTensors> results(const std::string& mode, int size) const {
    std::vector<smal::tensors::SafeTensors> files;
    std::vector<int> ranks(static_cast<std::size_t>(size));
    std::iota(ranks.begin(), ranks.end(), 0);
    const std::vector<Ended> all = launch(mode, size, ranks);
    for (std::size_t rank = 0; rank < all.size(); ++rank) {
      if (all[rank].status != 0) throw std::runtime_error(mode + ": " + all[rank].message);
      files.push_back(smal::tensors::SafeTensors::open(out(mode) + "." + std::to_string(rank)));
      std::filesystem::remove(files.back().path());  // the mapping stays
    }
    return files;
  }

 private:
  std::string out(const std::string& mode) const { return (scratch_.path() / mode).string(); }
  std::string errors(const std::string& mode, int rank) const {
    return out(mode) + ".stderr." + std::to_string(rank);
  }

  pid_t start(const std::string& mode, int rank, std::vector<std::string> environment) const {
    for (char** entry = environ; *entry != nullptr; ++entry) environment.emplace_back(*entry);
    std::vector<std::string> arguments{Q3D_RANK_STEPS, mode, out(mode)};
    const auto pointers = [](std::vector<std::string>& texts) {
      std::vector<char*> list;
      for (std::string& text : texts) list.push_back(text.data());
      list.push_back(nullptr);
      return list;
    };
    posix_spawn_file_actions_t actions;
    ::posix_spawn_file_actions_init(&actions);
    ::posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, errors(mode, rank).c_str(),
                                       O_WRONLY | O_CREAT | O_TRUNC, 0644);
    pid_t process = -1;
    EXPECT_EQ(::posix_spawn(&process, Q3D_RANK_STEPS, &actions, nullptr, pointers(arguments).data(),
                            pointers(environment).data()),
              0);
    ::posix_spawn_file_actions_destroy(&actions);
    return process;
  }

  testing::ScratchDir scratch_;
};

// |a - b| / |a - origin| in the L2 norm: the largest over all tensors of one kind. `from` names the kind that
// holds the origins; nothing is 0, for gradients. Each is measured against at least `least` times the norm of
// all, for some have a gradient of mere rounding, such as a bias that moves all keypoints alike where only
// their positions relative to the first count.
double worst_error(const smal::tensors::SafeTensors& expected, const smal::tensors::SafeTensors& got,
                   const std::string& kind, const std::string& from = "", double least = 1e-6) {
  std::vector<double> differences, sizes;
  for (const std::string& name : expected.names()) {
    if (!name.starts_with(kind)) continue;
    torch::Tensor size = expected.tensor(name);
    const std::string origin = from + name.substr(kind.size());
    if (!from.empty() && expected.contains(origin)) size = size - expected.tensor(origin);
    sizes.push_back(size.norm().item<double>());
    differences.push_back((expected.tensor(name) - got.tensor(name)).norm().item<double>());
  }
  EXPECT_GT(sizes.size(), 10U) << kind;
  const double all = std::sqrt(std::inner_product(sizes.begin(), sizes.end(), sizes.begin(), 0.0));
  EXPECT_GT(all, 0.0) << kind;
  double worst = 0.0;
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    worst = std::max(worst, differences[i] / std::max(sizes[i], least * all));
  }
  return worst;
}

void expect_equal_ranks(const std::vector<smal::tensors::SafeTensors>& ranks, const std::string& kind) {
  for (const std::string& name : ranks[0].names()) {
    if (name.starts_with(kind)) {
      EXPECT_TRUE(torch::equal(ranks[0].tensor(name), ranks[1].tensor(name))) << name;
    }
  }
}

TEST_F(Ranks, TwoEqualOneOnTheJointBatch) {
  const auto one = results("exact", 1);
  const auto two = results("exact", 2);
  // Otherwise nothing would tell a joint mean from a mean of means.
  for (const char* count : {"without_pose", "without_betas", "known_species"}) {
    EXPECT_NE(two[0].tensor(count).item<double>(), two[1].tensor(count).item<double>()) << count;
  }
  EXPECT_LT(worst_error(one[0], two[0], "gradient."), 1e-5);
  EXPECT_LT(worst_error(one[0], two[0], "weight.", "start."), 1e-5);
  expect_equal_ranks(two, "weight.");
  // The tolerance can tell: plain averages of what each rank would compute alone are far off.
  const auto naive = results("naive_exact", 2);
  EXPECT_GT(worst_error(one[0], naive[0], "gradient."), 1e-2);
  EXPECT_GT(worst_error(one[0], naive[0], "weight.", "start."), 1e-2);
}

TEST_F(Ranks, ThreeEqualOneToo) {
  EXPECT_LT(worst_error(results("exact", 1)[0], results("exact", 3)[0], "gradient."), 1e-5);
}

// Float32 adds in another order, so a difference of 1e-8 of the whole gradient, less than its machine
// epsilon, says nothing. AdamW then moves elements whose gradient is mere rounding by whole steps.
class Float32Ranks : public Ranks, public ::testing::WithParamInterface<const char*> {};

TEST_P(Float32Ranks, TwoReportAndMoveAsOne) {
  const auto one = results(GetParam(), 1);
  const auto two = results(GetParam(), 2);
  const torch::Tensor expected = one[0].tensor("report.0"), got = two[0].tensor("report.0");
  ASSERT_EQ(expected.sizes(), got.sizes());
  ASSERT_GE(expected.size(0), 7);
  EXPECT_LT(((expected - got).abs() / expected.abs().clamp_min(1e-6)).max().item<double>(), 1e-5);
  EXPECT_LT(worst_error(one[0], two[0], "gradient.", "", /*least=*/1e-4), 1e-4);
  EXPECT_LT(worst_error(one[0], two[0], "weight.", "start.", /*least=*/0.01), 0.05);
  expect_equal_ranks(two, "weight.");
  expect_equal_ranks(two, "report.");
  const auto naive = results(std::string("naive_") + GetParam(), 2);
  EXPECT_GT(worst_error(one[0], naive[0], "gradient.", "", /*least=*/1e-4), 1e-2);
}

INSTANTIATE_TEST_SUITE_P(Learners, Float32Ranks,
                         ::testing::Values("prima", "encoders", "prima_stem", "encoders_stem"));

TEST_F(Ranks, WhenOneLeavesTheOtherEndsAndSaysSo) {
  const auto start = std::chrono::steady_clock::now();
  const auto all = launch("leave", 2, {0, 1});
  EXPECT_EQ(all[1].status, 0);
  EXPECT_EQ(all[0].status, 1);
  EXPECT_THAT(all[0].message, HasSubstr("rank 0 of 2: working with the other ranks failed"));
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(120));
}

TEST_F(Ranks, WhoMeetsNobodyGivesUp) {
  for (const int rank : {0, 1}) {
    const auto ended = launch("wait", 2, {rank}).front();
    EXPECT_EQ(ended.status, 1);
    EXPECT_THAT(ended.message,
                HasSubstr("rank " + std::to_string(rank) + " of 2: the ranks did not meet at "));
  }
}

// Sets variables, and takes them back.
class Environment {
 public:
  explicit Environment(const std::vector<std::pair<std::string, std::string>>& variables) {
    for (const char* name : {"RANK", "WORLD_SIZE", "LOCAL_RANK", "LOCAL_WORLD_SIZE", "MASTER_ADDR",
                             "MASTER_PORT", "SLURM_PROCID", "SLURM_NTASKS", "SLURM_LOCALID",
                             "SLURM_NTASKS_PER_NODE", "SLURM_STEP_ID", "TORCHELASTIC_USE_AGENT_STORE"}) {
      ::unsetenv(name);
    }
    for (const auto& [name, value] : variables) ::setenv(name.c_str(), value.c_str(), 1);
    names_ = variables;
  }
  ~Environment() {
    for (const auto& [name, value] : names_) ::unsetenv(name.c_str());
  }
  Environment(const Environment&) = delete;
  Environment& operator=(const Environment&) = delete;

 private:
  std::vector<std::pair<std::string, std::string>> names_;
};

TEST(RankPlace, NothingSaidIsAWorldOfOne) {
  const Environment none({});
  EXPECT_EQ(rank_place_from_environment().size, 1);
}

TEST(RankPlace, FromTorchrun) {
  const Environment set({{"RANK", "5"},
                         {"WORLD_SIZE", "8"},
                         {"LOCAL_RANK", "1"},
                         {"LOCAL_WORLD_SIZE", "4"},
                         {"MASTER_ADDR", "node0"},
                         {"MASTER_PORT", "29500"},
                         {"TORCHELASTIC_USE_AGENT_STORE", "True"}});
  const RankPlace place = rank_place_from_environment();
  EXPECT_EQ(place.rank, 5);
  EXPECT_EQ(place.size, 8);
  EXPECT_EQ(place.local_rank, 1);
  EXPECT_EQ(place.local_size, 4);
  EXPECT_EQ(place.master_address, "node0");
  EXPECT_EQ(place.master_port, 29500);
  EXPECT_TRUE(place.launcher_has_store);
}

TEST(RankPlace, FromSrunButNotFromItsBatchScript) {
  std::vector<std::pair<std::string, std::string>> variables{{"SLURM_PROCID", "2"},
                                                             {"SLURM_NTASKS", "3"},
                                                             {"SLURM_LOCALID", "0"},
                                                             {"MASTER_ADDR", "node0"},
                                                             {"MASTER_PORT", "29500"}};
  {
    const Environment batch(variables);
    EXPECT_EQ(rank_place_from_environment().size, 1);
  }
  variables.emplace_back("SLURM_STEP_ID", "0");
  const Environment step(variables);
  const RankPlace place = rank_place_from_environment();
  EXPECT_EQ(place.rank, 2);
  EXPECT_EQ(place.size, 3);
  EXPECT_EQ(place.local_size, 1);
  EXPECT_FALSE(place.launcher_has_store);
}

void expect_refused(const std::vector<std::pair<std::string, std::string>>& variables,
                    const std::string& message) {
  const Environment set(variables);
  try {
    rank_place_from_environment();
    FAIL() << message;
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), HasSubstr(message));
  }
}

TEST(RankPlace, WhatIsMissingOrWrongIsNamed) {
  expect_refused({{"WORLD_SIZE", "2"}, {"MASTER_ADDR", "a"}, {"MASTER_PORT", "1"}}, "RANK: not set");
  expect_refused({{"WORLD_SIZE", "2"}, {"RANK", "2"}}, "RANK: got '2', expected 0 to 1");
  expect_refused({{"WORLD_SIZE", "two"}, {"RANK", "0"}}, "WORLD_SIZE: got 'two'");
  expect_refused({{"WORLD_SIZE", "2"}, {"RANK", "0"}, {"MASTER_ADDR", "a"}}, "MASTER_PORT: not set");
  expect_refused({{"WORLD_SIZE", "2"}, {"RANK", "0"}, {"MASTER_PORT", "1"}}, "MASTER_ADDR: not set");
  expect_refused({{"SLURM_STEP_ID", "0"}, {"SLURM_NTASKS", "2"}, {"SLURM_PROCID", "0"}},
                 "MASTER_PORT: not set");
}

}  // namespace
}  // namespace q3d::model::ranks
