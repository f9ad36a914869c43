#include "pipeline/candidates/duplicates.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/paths.h"

namespace q3d::pipeline::candidates {
namespace {

using manifests::Reason;
using ::testing::HasSubstr;

Candidate candidate(const std::string& id, double x_px = 10.0,
                    const std::string& sha256 = std::string(64, 'a')) {
  Candidate made;
  made.record.id = id;
  made.record.dataset = "lab";
  made.record.split = "train";
  made.record.keypoints[3] = {x_px, 20.0, 2.0F, 1.0F};
  made.image_sha256 = sha256;
  return made;
}

std::vector<Reason> reasons(const std::vector<Candidate>& pool, std::vector<IngestNote>* notes = nullptr) {
  const testing::ScratchDir scratch;
  CandidateList candidates(scratch.path());
  candidates.append(pool);
  std::vector<IngestNote> own;
  Duplicates duplicates;
  for (std::size_t i = 0; i < pool.size(); ++i) duplicates.add(i, pool[i]);
  duplicates.fail(candidates, notes == nullptr ? own : *notes);
  std::vector<Reason> all;
  for (const Candidate& each : candidates.read(0, candidates.size())) all.push_back(each.record.failure);
  return all;
}

TEST(Duplicates, the_first_of_each_is_kept) {
  std::vector<IngestNote> notes;
  EXPECT_EQ(
      reasons({candidate("1"), candidate("2", 10.4), candidate("3", 40.0), candidate("4", 40.0)}, &notes),
      (std::vector{Reason::none, Reason::duplicate, Reason::none, Reason::duplicate}));
  ASSERT_EQ(notes.size(), 1U);
  EXPECT_EQ(notes[0].kind, loaders::formats::NoteKind::caution);
  EXPECT_EQ(notes[0].dataset, "lab/train");
  EXPECT_THAT(notes[0].text, HasSubstr(": 2, first 2"));
}

TEST(Duplicates, notes_name_the_first_in_order_whatever_the_pictures) {
  const auto of = [](char digit) { return std::string(64, digit); };
  std::vector<IngestNote> notes;
  // The picture of the first repeated candidate has the larger digest, and one digest begins like another.
  const std::string like_b = std::string(32, 'b') + std::string(32, 'c');
  EXPECT_EQ(
      reasons({candidate("1", 10.0, of('b')), candidate("2", 10.0, of('a')), candidate("3", 10.0, of('b')),
               candidate("4", 10.0, of('a')), candidate("5", 10.0, like_b)},
              &notes),
      (std::vector{Reason::none, Reason::none, Reason::duplicate, Reason::duplicate, Reason::none}));
  ASSERT_EQ(notes.size(), 1U);
  EXPECT_THAT(notes[0].text, HasSubstr(": 2, first 3"));
}

TEST(Duplicates, other_animals_are_no_duplicates) {
  EXPECT_EQ(reasons({candidate("1"), candidate("2", 10.6)}), (std::vector{Reason::none, Reason::none}));
  EXPECT_EQ(reasons({candidate("1"), candidate("2", 10.0, std::string(64, 'b'))}),
            (std::vector{Reason::none, Reason::none}));
  Candidate hidden = candidate("2");
  hidden.record.keypoints[5] = {1.0, 1.0, 2.0F, 1.0F};
  EXPECT_EQ(reasons({candidate("1"), hidden}), (std::vector{Reason::none, Reason::none}));
  Candidate unlabelled = candidate("2");
  unlabelled.record.keypoints[5] = {77.0, 77.0, 0.0F, 0.0F};
  EXPECT_EQ(reasons({candidate("1"), unlabelled}), (std::vector{Reason::none, Reason::duplicate}))
      << "where an unlabelled point lies says nothing";
}

TEST(Duplicates, photographs_without_keypoints_go_by_their_boxes) {
  std::vector<Candidate> photographs{candidate("1"), candidate("2"), candidate("3")};
  for (Candidate& each : photographs) each.record.keypoints[3].weight = 0.0F;
  for (Candidate& each : photographs) each.record.box = {10.0, 10.0, 80.0, 60.0};
  photographs[1].record.box.x_px = 90.0;
  EXPECT_EQ(reasons(photographs), (std::vector{Reason::none, Reason::none, Reason::duplicate}));
}

TEST(Duplicates, labels_of_another_role_and_failed_ones_do_not_count) {
  Candidate truth = candidate("2");
  truth.role = config::Role::truth;
  EXPECT_EQ(reasons({candidate("1"), truth}), (std::vector{Reason::none, Reason::none}));
  Candidate failed = candidate("1");
  failed.record.failure = Reason::size_mismatch;
  EXPECT_EQ(reasons({failed, candidate("2")}), (std::vector{Reason::size_mismatch, Reason::none}));
}

// Five keypoints of an animal in a box of 100 px, moved by `dx_px`.
Candidate animal(const std::string& id, double dx_px) {
  Candidate made = candidate(id);
  made.record.box = {0.0, 0.0, 100.0, 60.0};
  for (std::size_t i = 0; i < 5; ++i) made.record.keypoints[i] = {10.0 * i + dx_px, 20.0, 2.0F, 1.0F};
  return made;
}

TEST(Duplicates, an_animal_that_two_people_labelled_is_told_and_kept) {
  std::vector<IngestNote> notes;
  EXPECT_EQ(reasons({animal("1", 0.0), animal("2", 4.0)}, &notes), (std::vector{Reason::none, Reason::none}));
  ASSERT_EQ(notes.size(), 1U);
  EXPECT_EQ(notes[0].kind, loaders::formats::NoteKind::caution);
  EXPECT_THAT(notes[0].text, HasSubstr("so it counts twice: 1, first 2 after 1"));
  notes.clear();
  EXPECT_EQ(reasons({animal("1", 0.0), animal("2", 6.0)}, &notes), (std::vector{Reason::none, Reason::none}));
  EXPECT_EQ(notes.size(), 0U) << "two animals side by side";
  Candidate own = animal("2", 4.0);
  own.role = config::Role::truth;
  reasons({animal("1", 0.0), own}, &notes);
  EXPECT_EQ(notes.size(), 0U) << "the labels of another role";
}

}  // namespace
}  // namespace q3d::pipeline::candidates
