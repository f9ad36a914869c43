#include "pipeline/candidates/candidate_list.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>

#include "manifests/record_json.h"
#include "tests/support/paths.h"

namespace q3d::pipeline::candidates {
namespace {

using manifests::Reason;

// A candidate in which every member has a value of its own.
Candidate full(int number) {
  Candidate made;
  manifests::SampleRecord& record = made.record;
  record.id = "lab/train/" + std::to_string(number);
  record.dataset = "lab";
  record.split = "train";
  record.source = "zoo";
  record.species = std::string("a\0b", 3);
  record.family = manifests::Family::equidae;
  record.image_path = "/data/" + std::to_string(number);
  record.image_ref = "ref";
  record.mask_path = "/data/mask";
  record.width_px = 640;
  record.height_px = 480 + number;
  record.orientation = 6;
  record.scale = 0.1;
  record.box = {1.0, 2.0, std::numeric_limits<double>::infinity(), 4.0};
  record.keypoints[25] = {1.0 / 3.0, std::numeric_limits<double>::quiet_NaN(), 2.0F, 0.25F};
  record.truth.emplace().has_betas = true;
  record.truth->betas[40] = 0.5F;
  record.truth->keypoints_3d[77] = -0.0F;
  record.failure = Reason::size_mismatch;
  record.failure_detail = "got 1, expected 2";
  made.image_sha256 = "aa";
  made.mask_sha256 = "bb";
  made.role = config::Role::truth;
  made.finding = "none";
  return made;
}

std::string text_of(const Candidate& candidate) {
  const nlohmann::json all{candidate.record,          candidate.image_sha256,
                           candidate.mask_sha256,     to_string(candidate.role),
                           candidate.finding,         manifests::to_string(candidate.exclusion.reason),
                           candidate.exclusion.detail};
  return all.dump();
}

TEST(CandidateList, GivesBackWhatWasAppended) {
  const testing::ScratchDir scratch;
  CandidateList list(scratch.path());
  EXPECT_EQ(list.size(), 0U);
  EXPECT_TRUE(list.read(0, 0).empty());
  list.append({});
  std::vector<Candidate> all;
  for (int i = 0; i < 1500; ++i) all.push_back(i % 3 == 0 ? Candidate() : full(i));
  list.append(std::span(all).first(7));
  list.append(std::span(all).subspan(7));
  ASSERT_EQ(list.size(), all.size());
  EXPECT_EQ(text_of(list.at(8)), text_of(all[8]));
  std::size_t seen = 0;
  list.for_each([&](std::size_t i, const Candidate& candidate) {
    EXPECT_EQ(i, seen++);
    EXPECT_EQ(text_of(candidate), text_of(all[i]));
  });
  EXPECT_EQ(seen, all.size());
  EXPECT_EQ(list.read(5, 4).size(), 4U);
  EXPECT_THROW(list.read(1499, 2), std::out_of_range);
  EXPECT_TRUE(std::filesystem::is_empty(scratch.path())) << "the file has no name";
}

TEST(CandidateList, KeepsWhatIsSetLater) {
  const testing::ScratchDir scratch;
  CandidateList list(scratch.path());
  std::vector<Candidate> all(6);
  all[1].exclusion = {Reason::vetoed, "before"};
  list.append(all);
  list.fail(4, Reason::duplicate, "of another");
  list.exclude(2, {Reason::in_test_split, "a copy"});
  list.exclude(1, {Reason::vetoed, "later"});
  for (const std::size_t first : {0U, 1U}) {  // a part begins elsewhere
    const std::vector<Candidate> part = list.read(first, 4);
    EXPECT_EQ(part[1 - first].exclusion.detail, "later");
    EXPECT_EQ(part[2 - first].exclusion.reason, Reason::in_test_split);
    EXPECT_EQ(part[3 - first].record.failure, Reason::none);
  }
  EXPECT_EQ(list.at(4).record.failure, Reason::duplicate);
  EXPECT_EQ(list.at(4).record.failure_detail, "of another");
  EXPECT_EQ(list.exclusions().size(), 2U);
}

}  // namespace
}  // namespace q3d::pipeline::candidates
