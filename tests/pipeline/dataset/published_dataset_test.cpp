#include "pipeline/dataset/published_dataset.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include <functional>
#include <stdexcept>

#include "manifests/atomic_file.h"
#include "manifests/digest.h"
#include "manifests/journal.h"
#include "manifests/sealed_json.h"
#include "pipeline/dataset/explain.h"
#include "pipeline/dataset/verify.h"
#include "pipeline/stages/stage_store.h"
#include "pipeline/unit/annotated_body.h"
#include "pipeline/unit/unit_tables.h"
#include "tests/pipeline/dataset/made_dataset.h"
#include "tests/support/paths.h"

namespace q3d::pipeline::dataset {
namespace {

using manifests::LabelKind;
using manifests::Reason;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::string message(const std::function<void()>& call) {
  try {
    call();
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "nothing thrown";
}

class Published : public ::testing::Test {
 protected:
  // The same dataset.json with one text replaced, and the digest of that text.
  void replace(const std::string& from, const std::string& to) {
    std::string text = read_dataset_document(version_).dump(2);
    ASSERT_NE(text.find(from), std::string::npos);
    text.replace(text.find(from), from.size(), to);
    manifests::write_file_atomically(version_ / "dataset.json",
                                     manifests::seal_json(nlohmann::ordered_json::parse(text)));
  }
  // The predict stage's table of unit 0, of candidates with these ids, as a build leaves it.
  void write_predictions(const std::vector<std::string>& ids) {
    std::vector<candidates::Candidate> candidates;
    for (const std::string& id : ids) candidates.emplace_back().record.id = id;
    std::vector<unit::PredictedSample> samples(ids.size());
    for (unit::PredictedSample& sample : samples) sample.body = unit::no_body();
    samples[1].failure = Reason::image_empty;
    stages::StageStore store(folder_.path(), "predict", std::string(64, '1'));
    store.save({.index = 0, .first = 0, .count = ids.size(), .input_digest = "x", .label_digest = "x"},
               unit::to_table(candidates, samples));
  }

  q3d::testing::ScratchDir folder_;
  std::filesystem::path version_ = make_dataset(folder_.path());
};

TEST_F(Published, IsOpenedByItsFolderOrByTheOutputFolder) {
  for (const auto& given : {version_, folder_.path(), folder_.path() / "latest"}) {
    const PublishedDataset dataset(given);
    EXPECT_EQ(dataset.version_name(), "made-0123456789ab");
    EXPECT_EQ(std::filesystem::canonical(dataset.output_folder()),
              std::filesystem::canonical(folder_.path()));
  }
  EXPECT_THAT(message([&] { PublishedDataset(version_ / "shards"); }),
              HasSubstr("expected a dataset folder"));
}

TEST_F(Published, GivesDatasetJsonAsTypedValues) {
  const PublishedDataset dataset(version_);
  const DatasetManifest& manifest = dataset.manifest();
  EXPECT_EQ(manifest.counts, (Counts{4, 2, 0, 1, 1}));
  EXPECT_EQ(manifest.labels.at(LabelKind::two_d_only), 2);
  EXPECT_EQ(manifest.reasons,
            (std::map<Reason, std::int64_t>{{Reason::image_empty, 1}, {Reason::error_too_large, 1}}));
  EXPECT_EQ(manifest.by_family.at(manifests::Family::canidae).counts.failed, 1);
  EXPECT_EQ(manifest.thresholds.at("pool").tau_high, 0.08);
  EXPECT_EQ(manifest.unit_size, 2U);
  EXPECT_EQ(manifest.keys.refine, std::string(64, '2'));
  EXPECT_EQ(manifest.keys.measure, "");
  EXPECT_FALSE(manifest.all.mean_final_error);
}

TEST_F(Published, KnowsTheTermsOfItsDatasets) {
  EXPECT_EQ(read_dataset_manifest(version_).terms.at("zoo/train"),
            (manifests::DatasetTerms{"CC-BY-4.0", "https://example.org/zoo", "A zoo"}));
}

TEST_F(Published, ReadsADatasetOfSchema1AndRefusesALaterOne) {
  replace("\"schema\": 2", "\"schema\": 1");
  replace("\"datasets\": {", "\"not_in_schema_1\": {");
  EXPECT_TRUE(read_dataset_manifest(version_).terms.empty());
  replace("\"schema\": 1", "\"schema\": 3");
  EXPECT_THAT(message([&] { PublishedDataset{version_}; }),
              HasSubstr("schema is 3, this toolkit reads 1 to 2"));
}

TEST_F(Published, EveryFlippedBitOfDatasetJsonIsFound) {
  const std::string sound = manifests::read_file(version_ / "dataset.json");
  for (std::size_t at = 0; at < sound.size(); ++at) {
    std::string text = sound;
    text[at] = static_cast<char>(text[at] ^ (1 << at % 8));
    manifests::write_file_atomically(version_ / "dataset.json", text);
    EXPECT_THROW(read_dataset_manifest(version_), manifests::DamagedDocument) << "byte " << at;
  }
}

TEST_F(Published, OnlySchema1HasNoDigest) {
  const std::string sound = manifests::read_file(version_ / "dataset.json");
  const std::string plain = read_dataset_document(version_).dump(2);
  manifests::write_file_atomically(version_ / "dataset.json", plain);
  EXPECT_THAT(message([&] { PublishedDataset{version_}; }), HasSubstr("got no digest at its end"));
  std::string old = plain;
  old.replace(old.find("\"schema\": 2"), 11, "\"schema\": 1");
  manifests::write_file_atomically(version_ / "dataset.json", old);
  EXPECT_EQ(read_dataset_manifest(version_).schema, 1);
}

TEST_F(Published, RefusesShardsOutsideItsFolder) {
  std::string name = "shards/000001.h5";
  for (const char* other :
       {"/etc/shadow", "../000001.h5", "shards/../../000001.h5", "shards//etc/shadow", "shards\\\\..\\\\a.h5",
        "shards/a\\u0000.h5", "shards/.h5", "shards", "000001.h5", ""}) {
    replace("\"" + name + "\"", "\"" + std::string(other) + "\"");
    EXPECT_THAT(message([&] { verify(version_, true); }), HasSubstr("the list of shards names \"")) << other;
    name = other;
  }
}

TEST_F(Published, KnowsRoleLabelAndPlaceOfACandidate) {
  const PublishedDataset dataset(version_);
  const VerdictRow kept = dataset.verdict("zoo/train/d.jpg#3");
  EXPECT_EQ(dataset.role(kept), config::Role::two_d_only);
  EXPECT_EQ(dataset.label_kind(kept), LabelKind::two_d_only);
  EXPECT_EQ(dataset.unit_of(kept), 1);
  EXPECT_EQ(dataset.place_in_unit(kept), 1U);
  EXPECT_EQ(dataset.sample(kept).record.id, kept.id);
  const VerdictRow dropped = dataset.verdict("pool/test/c.jpg#2");
  EXPECT_EQ(dataset.role(dropped), config::Role::pseudo);
  EXPECT_EQ(dataset.label_kind(dropped), std::nullopt);
  EXPECT_THAT(
      message([&] { dataset.verdict("zoo/train/d.jpg#4"); }),
      HasSubstr("no candidate has \"zoo/train/d.jpg#4\" as its id or as a part of its id; the nearest is "
                "zoo/train/d.jpg#3"));
}

TEST_F(Published, FindsACandidateByAPartOfItsId) {
  const PublishedDataset dataset(version_);
  EXPECT_EQ(dataset.verdict("d.jpg").id, "zoo/train/d.jpg#3");
  EXPECT_EQ(dataset.verdict("test/c").id, "pool/test/c.jpg#2");
  const std::string several = message([&] { dataset.verdict(".jpg#"); });
  EXPECT_THAT(several, HasSubstr("\".jpg#\" is a part of the ids of 4 candidates"));
  EXPECT_THAT(several, HasSubstr("\n  pool/test/c.jpg#2"));
  EXPECT_THAT(several, HasSubstr("\n  zoo/train/d.jpg#3"));
}

TEST_F(Published, RefusesNamesThatItDoesNotKnow) {
  replace("\"image_empty\"", "\"image_odd\"");
  EXPECT_THAT(message([&] { PublishedDataset{version_}; }),
              ::testing::AllOf(HasSubstr("dataset.json"), HasSubstr("unknown reason \"image_odd\"")));
  replace("\"image_odd\"", "\"image_empty\"");
  replace("\"role\": \"2d_only\"", "\"role\": \"3d\"");
  EXPECT_THAT(message([&] { PublishedDataset{version_}; }), HasSubstr("unknown role \"3d\""));
}

TEST_F(Published, ReadsTheStagesTablesWhileTheyAreThere) {
  const PublishedDataset dataset(version_);
  EXPECT_FALSE(dataset.predictions(0));
  write_predictions({"zoo/train/a.jpg#0", "zoo/train/b.jpg#1"});
  const auto predictions = dataset.predictions(0);
  ASSERT_TRUE(predictions);
  EXPECT_EQ(predictions->candidates[1].id, "zoo/train/b.jpg#1");
  EXPECT_EQ(predictions->samples[1].failure, Reason::image_empty);
  EXPECT_FALSE(dataset.predictions(1));
  EXPECT_FALSE(dataset.refinements(0));
  EXPECT_FALSE(dataset.measures(0));
}

TEST_F(Published, ADamagedTableIsRefusedAndToldByExplain) {
  write_predictions({"zoo/train/a.jpg#0", "zoo/train/b.jpg#1"});
  const PublishedDataset dataset(version_);
  const auto file =
      stages::unit_file(stages::stage_folder(folder_.path(), "predict", std::string(64, '1')), 0);
  std::string bytes = manifests::read_file(file);
  bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 1);
  std::filesystem::permissions(file, std::filesystem::perms::owner_all);
  manifests::write_file_atomically(file, bytes);
  EXPECT_THAT(message([&] { dataset.predictions(0); }), HasSubstr("its journal says"));
  const auto story = explain(version_, "zoo/train/a.jpg#0");
  EXPECT_THAT(story.at("missing")[0].get<std::string>(), HasSubstr("its journal says"));
}

TEST_F(Published, ExplainTellsOfEveryCandidate) {
  const auto why = [&](const char* id) { return explain(version_, id).at("why").get<std::string>(); };
  EXPECT_EQ(why("zoo/train/b.jpg#1"), "The picture's file is empty: got 0 bytes, expected a picture.");
  EXPECT_THAT(why("pool/test/c.jpg#2"), HasSubstr("0.0900, reaches tau_high = 0.0800."));
  const auto kept = explain(version_, "zoo/train/a.jpg#0");
  EXPECT_EQ(kept.at("label").at("kind"), "2d_only");
  EXPECT_EQ(kept.at("verdict").at("initial_error"), nullptr);
  const std::string told = tell(kept);
  EXPECT_THAT(told, HasSubstr("row 0 of shards/000000.h5. The sample has annotated keypoints and no body."));
}

TEST_F(Published, IsSoundAndVerifySeesWhereVerdictsAndShardsDiffer) {
  EXPECT_THAT(verify(version_, true).problems, ::testing::IsEmpty());
  // The candidate c is kept instead of d, and dataset.json has the digest of that table.
  std::string other = kVerdicts;
  const auto change = [&](const std::string& from, const std::string& to) {
    other.replace(other.find(from), from.size(), to);
  };
  change("discarded,error_too_large", "retained,none");
  change("bovidae,,,cc", "bovidae,1,0,cc");
  change("d.jpg#3,retained,none", "d.jpg#3,discarded,vetoed");
  change("none,1,0,dd", "none,,,dd");
  manifests::write_file_atomically(version_ / "verdicts.csv", other);
  replace(manifests::sha256(kVerdicts), manifests::sha256(other));
  EXPECT_THAT(
      verify(version_, true).problems,
      ElementsAre("verdicts.csv keeps 2 candidates and the shards hold 2; 1 of the first are not among "
                  "the second with their verdict"));
}

}  // namespace
}  // namespace q3d::pipeline::dataset
