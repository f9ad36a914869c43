#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "pipeline/device/domain.h"
#include "pipeline/run/errors.h"
#include "tests/pipeline/training/training_run_fixture.h"

namespace q3d::pipeline::training {
namespace {

using ::testing::HasSubstr;

TEST_F(TrainingRun, StoppedAnywhereItEndsWithTheSameWeights) {
  const TrainingSummary straight = run("straight");
  EXPECT_TRUE(straight.finished);
  EXPECT_EQ(straight.steps_done, 6);
  // Stops inside the first phase, after its last step, and inside the second; other threads, other
  // read-ahead.
  EXPECT_FALSE(run("stopped", 1).finished);
  config_.feed_ahead = 0;
  EXPECT_EQ(run("stopped", 2, 3).steps_done, 3);
  EXPECT_EQ(run("stopped", 2).steps_done, 5);
  const TrainingSummary last = run("stopped");
  EXPECT_TRUE(last.finished);
  EXPECT_EQ(last.steps_here, 1);
  EXPECT_EQ(manifests::read_file(straight.model), manifests::read_file(last.model));
  EXPECT_EQ(manifests::read_file(path("straight/state.safetensors")),
            manifests::read_file(path("stopped/state.safetensors")));
}

TEST_F(TrainingRun, EncodersAreTrainedAloneAndResume) {
  const PoolConfig first{"first", {path("first.h5").string()}, 1.0};
  config_.phases = {{"encoders", Objective::encoders, {}, {first}, 4, 1, false, 1e-3, 1, Decay::linear}};
  const TrainingSummary straight = run("straight");
  run("stopped", 1);
  EXPECT_EQ(manifests::read_file(straight.model), manifests::read_file(run("stopped").model));
  const smal::tensors::SafeTensors before = smal::tensors::SafeTensors::open(path("initial"));
  const smal::tensors::SafeTensors after = smal::tensors::SafeTensors::open(straight.model);
  for (const std::string& name : before.names()) {
    const bool encoder =
        name.starts_with("backbone.") || name.starts_with("bioclip_embedding.species_model.");
    EXPECT_NE(torch::equal(before.tensor(name), after.tensor(name)), encoder) << name;
  }
}

TEST_F(TrainingRun, AStemLearnsBehindItsFrozenBlocksAndResumes) {
  model::PrimaConfig sizes = model::checkpoint_config(smal::tensors::SafeTensors::open(path("initial")));
  sizes.efficientnet_stem = true;
  model::write_initial_checkpoint(path("initial"), sizes, 3, torch::kFloat32,
                                  testing::source_dir() / "models" / "efficientnet_lite0.safetensors");
  config_.frozen_stem_blocks = 4;
  config_.stem_rate = 0.5;
  const PoolConfig first{"first", {path("first.h5").string()}, 1.0};
  config_.phases = {{"encoders", Objective::encoders, {}, {first}, 2, 1, false, 1e-3, 0, Decay::none},
                    {"joint", Objective::prima, {}, {first}, 2, 1, false, 1e-3, 0, Decay::none}};
  const TrainingSummary straight = run("straight");
  run("stopped", 1);
  run("stopped", 2);
  EXPECT_EQ(manifests::read_file(straight.model), manifests::read_file(run("stopped").model));
  const smal::tensors::SafeTensors before = smal::tensors::SafeTensors::open(path("initial"));
  const smal::tensors::SafeTensors after = smal::tensors::SafeTensors::open(straight.model);
  EXPECT_EQ(after.metadata().at("stem_licence"), before.metadata().at("stem_licence"));
  const std::string prefix = "backbone.patch_embed.efficientnet.";
  for (const std::string& name : before.names()) {
    if (!name.starts_with(prefix)) continue;
    bool frozen = false;
    for (const char* part :
         {"_conv_stem.", "_bn0.", "_blocks.0.", "_blocks.1.", "_blocks.2.", "_blocks.3."}) {
      frozen = frozen || name.starts_with(prefix + part);
    }
    EXPECT_EQ(torch::equal(before.tensor(name), after.tensor(name)), frozen) << name;
  }
}

std::vector<double> gradient_norms(const std::filesystem::path& log) {
  std::ifstream lines(log);
  std::vector<double> norms;
  for (std::string line; std::getline(lines, line);) {
    norms.push_back(nlohmann::json::parse(line).at("gradient_norm"));
  }
  return norms;
}

TEST_F(TrainingRun, ABatchInPartsTrainsAsTheWholeAndResumes) {
  model::PrimaConfig sizes = model::checkpoint_config(smal::tensors::SafeTensors::open(path("initial")));
  sizes.dropout = sizes.drop_path = 0.0;
  model::write_initial_checkpoint(path("initial"), sizes, 3);
  const PoolConfig first{"first", {path("first.h5").string()}, 1.0};
  config_.feed.batch = 5;
  config_.phases = {{"encoders", Objective::encoders, {}, {first}, 1, 1, false, 1e-3, 0, Decay::none},
                    {"joint", Objective::prima, {}, {first}, 2, 1, true, 1e-5, 0, Decay::none}};
  run("whole");
  config_.batch_parts = 3;
  const TrainingSummary parts = run("parts");
  run("stopped", 2);
  EXPECT_EQ(manifests::read_file(parts.model), manifests::read_file(run("stopped").model));
  const std::vector<double> expected = gradient_norms(path("whole/log.jsonl"));
  const std::vector<double> got = gradient_norms(path("parts/log.jsonl"));
  ASSERT_EQ(expected.size(), 3U);
  ASSERT_EQ(got.size(), 3U);
  EXPECT_NEAR(got[0], expected[0], 1e-4 * expected[0]);
  EXPECT_NEAR(got[1], expected[1], 1e-2 * expected[1]);  // of weights that Adam has moved
}

TEST_F(TrainingRun, ABatchHasAtLeastOneSampleInEachPart) {
  config_.batch_parts = 3;
  EXPECT_THAT(message([&] { run("out"); }), HasSubstr("batch_parts: got 3, expected at most 2"));
}

TEST_F(TrainingRun, OneSpeciesCannotBeTold) {
  testing::write_sample_shard(path("single.h5"), "single", 1, 1);
  config_.phases = {{"encoders",
                     Objective::encoders,
                     {},
                     {{"single", {path("single.h5").string()}, 1.0}},
                     4,
                     1,
                     false,
                     1e-3,
                     0,
                     Decay::linear}};
  EXPECT_THROW(run("out"), run::ConfigError);
}

TEST_F(TrainingRun, AKilledRunRepeatsStepsAfterItsNewestState) {
  const TrainingSummary straight = run("straight");
  run("killed", 2);
  std::filesystem::copy_file(path("killed/state.safetensors"), path("old"));
  run("killed", 1);
  // The folder looks as if the process had died before it saved step 3.
  std::filesystem::rename(path("old"), path("killed/state.safetensors"));
  const TrainingSummary last = run("killed");
  EXPECT_EQ(manifests::read_file(straight.model), manifests::read_file(last.model));
  std::ifstream log(path("killed/log.jsonl"));
  std::vector<std::pair<int, int>> steps;
  for (std::string line; std::getline(log, line);) {
    const auto document = nlohmann::json::parse(line);
    steps.emplace_back(document.at("phase"), document.at("step"));
  }
  EXPECT_THAT(steps, ::testing::ElementsAre(std::pair(0, 1), std::pair(0, 2), std::pair(0, 3),
                                            std::pair(1, 1), std::pair(1, 2), std::pair(1, 3)));
}

TEST_F(TrainingRun, TheWeightsLoadAsACheckpoint) {
  const TrainingSummary summary = run("out");
  const model::Prima prima = model::Prima::load(summary.model, path("asset"), torch::kCPU);
  EXPECT_EQ(prima.config().ief_iterations, 1);
  const smal::tensors::SafeTensors before = smal::tensors::SafeTensors::open(path("initial"));
  const smal::tensors::SafeTensors after = smal::tensors::SafeTensors::open(summary.model);
  EXPECT_FALSE(
      torch::equal(before.tensor("smal_head.decpose.2.weight"), after.tensor("smal_head.decpose.2.weight")));
  EXPECT_NO_THROW(model::Prima::load(path("out/state.safetensors"), path("asset"), torch::kCPU));
}

// L_proj of a sample by its definition, without the program's own metric.
double l_proj_of(const std::filesystem::path& model, const std::filesystem::path& asset,
                 const std::filesystem::path& shard) {
  feed::FeedOptions options;
  options.batch = 1;
  options.augment = false;
  std::vector<feed::ShardPool> pools;
  pools.emplace_back("one", std::vector{shard});
  feed::FeedBatch batch = feed::Feed(std::move(pools), {1.0}, options, 0).batch(0);
  const model::Prima prima = model::Prima::load(model, asset, torch::kCPU);
  const torch::Tensor images = torch::from_blob(batch.images.get(), {1, 3, 256, 256});
  const torch::Tensor projected = prima.predict(prima.encode(images)).keypoints_2d[0];
  const torch::Tensor labels = torch::from_blob(batch.keypoints_2d.data(), {26, 3});
  const torch::Tensor visible = labels.select(1, 2) > 0;
  return (projected - labels.narrow(1, 0, 2)).abs().index({visible}).mean().item<double>();
}

// Every draw from a pool of one sample is that sample, so all quantiles are its L_proj.
TEST_F(TrainingRun, TheWeightsSayWhatTheyKnow) {
  testing::write_sample_shard(path("unseen.h5"), "unseen", 1, 90);
  const TrainingSummary silent = run("silent");
  config_.domain = {"rendered", "two shards", "unseen", {"unseen", {path("unseen.h5").string()}, 1.0}, 21};
  const TrainingSummary summary = run("out");
  const smal::tensors::SafeTensors without = smal::tensors::SafeTensors::open(silent.model);
  const smal::tensors::SafeTensors with = smal::tensors::SafeTensors::open(summary.model);
  EXPECT_FALSE(without.metadata().contains(device::kDomainKey));
  for (const std::string& name : with.names()) {
    EXPECT_TRUE(torch::equal(with.tensor(name), without.tensor(name))) << name;
  }
  const device::NetworkDomain domain = device::domain_from_json(with.metadata().at(device::kDomainKey));
  EXPECT_EQ(domain.pictures, device::Pictures::rendered);
  EXPECT_EQ(domain.trained_on, "two shards");
  EXPECT_EQ(domain.held_out, "unseen");
  EXPECT_EQ(domain.held_out_pictures, 22);  // whole batches of two
  const double expected = l_proj_of(summary.model, path("asset"), path("unseen.h5"));
  EXPECT_GT(expected, 0.001);
  ASSERT_EQ(domain.quantiles.size(), 5U);
  for (const device::ErrorQuantile& each : domain.quantiles) EXPECT_NEAR(each.l_proj, expected, 1e-5);
}

// The pictures were packed another time, into a shard of another digest, of which training sees a part.
TEST_F(TrainingRun, AHeldOutPoolThatTrainingSeesIsRefused) {
  testing::write_sample_shard(path("again.h5"), "again", 3, 45);
  config_.domain = {"rendered", "two shards", "again", {"again", {path("again.h5").string()}, 1.0}, 20};
  const std::string text = message([&] { run("out"); });
  EXPECT_THAT(text, HasSubstr("2 of the 3 pictures of the pool again are in the pool second too"));
  EXPECT_FALSE(std::filesystem::exists(path("out/model.safetensors")));
}

TEST_F(TrainingRun, EncodersAloneSayNothingOfBodies) {
  const PoolConfig first{"first", {path("first.h5").string()}, 1.0};
  config_.phases = {{"encoders", Objective::encoders, {}, {first}, 1, 1, false, 1e-3, 0, Decay::none}};
  config_.domain = {"rendered", "one shard", "", {}, 20};
  EXPECT_FALSE(smal::tensors::SafeTensors::open(run("out").model).metadata().contains(device::kDomainKey));
}

TEST_F(TrainingRun, AFinishedRunHasNothingToDo) {
  const std::string first = manifests::read_file(run("out").model);
  const TrainingSummary again = run("out");
  EXPECT_TRUE(again.finished);
  EXPECT_EQ(again.steps_here, 0);
  EXPECT_EQ(manifests::read_file(again.model), first);
}

TEST_F(TrainingRun, AnotherConfigurationNeedsAnotherFolder) {
  run("out", 1);
  config_.phases[0].learning_rate = 1e-4;
  EXPECT_THROW(run("out"), run::ConfigError);
}

TEST_F(TrainingRun, EncodersMayComeFromAnotherCheckpoint) {
  model::PrimaConfig sizes = model::checkpoint_config(smal::tensors::SafeTensors::open(path("initial")));
  model::write_initial_checkpoint(path("other"), sizes, 99);
  config_.network.encoders = path("other");
  const smal::tensors::SafeTensors after = smal::tensors::SafeTensors::open(run("out").model);
  const std::string frozen = "bioclip_embedding.species_model.visual.conv1.weight";
  EXPECT_TRUE(
      torch::equal(after.tensor(frozen), smal::tensors::SafeTensors::open(path("other")).tensor(frozen)));
}

TEST_F(TrainingRun, AnAblationTravelsWithTheWeights) {
  config_.network.without = {"initial_betas", "keypoint_tokens"};
  const auto sizes = model::checkpoint_config(smal::tensors::SafeTensors::open(run("out").model));
  EXPECT_FALSE(sizes.betas_from_bio);
  EXPECT_FALSE(sizes.keypoint_tokens);
  EXPECT_FALSE(sizes.learn_bio_encoder);
}

TEST_F(TrainingRun, WithoutBioFeaturesTheBioEncoderStartsAnewAndLearns) {
  const std::string bio = "bioclip_embedding.species_model.visual.conv1.weight";
  const smal::tensors::SafeTensors initial = smal::tensors::SafeTensors::open(path("initial"));
  model::write_initial_checkpoint(path("other"), model::checkpoint_config(initial), 99);
  config_.network.encoders = path("other");
  config_.network.without = {"bio_features"};
  run("none", 0);
  const smal::tensors::SafeTensors after = smal::tensors::SafeTensors::open(path("none/model.safetensors"));
  const double from_initial = (after.tensor(bio) - initial.tensor(bio)).abs().max().item<double>();
  EXPECT_GT(from_initial, 0.0);
  EXPECT_LT(from_initial, 0.02);  // six steps of at most 1e-3, and weight decay
  EXPECT_TRUE(model::checkpoint_config(after).learn_bio_encoder);
}

TEST_F(TrainingRun, ALossThatIsNotFiniteNamesTheSamples) {
  manifests::ShardSample bad = testing::shard_sample("poison/0", 5, true);
  bad.body.betas[3] = 1e30F;  // its square is beyond float32
  manifests::ShardHeader header;
  header.image_encoding = manifests::ImageEncoding::png;
  manifests::write_shard(path("poison.h5"), header, {bad});
  config_.phases[0].pools.push_back({"poison", {path("poison.h5").string()}, 1000.0});
  try {
    run("out");
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("step 1 of phase \"warm-up\": the loss is inf"));
    EXPECT_THAT(error.what(), HasSubstr("poison/0"));
  }
}

TEST_F(TrainingRun, ADamagedShardIsRefusedOrLeftOutAndNamed) {
  const auto shards = train_on_dataset({4, 5});
  EXPECT_TRUE(run("sound").finished);
  const std::uintmax_t bytes = std::filesystem::file_size(shards[1]);
  for (std::size_t at = 100; at < bytes; at += bytes / 9) {
    flip_bit(shards[1], at);
    const std::string text = message([&] { run("damaged"); });
    EXPECT_THAT(text, HasSubstr("1 of the pools' shards and samples are damaged")) << "byte " << at;
    EXPECT_THAT(text, HasSubstr(shards[1].string() + ": its SHA-256 is"));
    EXPECT_FALSE(std::filesystem::exists(path("damaged/state.safetensors")));
    flip_bit(shards[1], at);
  }
  flip_bit(shards[1], bytes / 2);
  const TrainingSummary skipped = run_without_damage("skipped");
  EXPECT_TRUE(skipped.finished);
  EXPECT_THAT(skipped.left_out, ::testing::ElementsAre(HasSubstr("pool set: " + shards[1].string())));
  train_on(shards[0].string());  // the same samples, and no others
  EXPECT_EQ(manifests::read_file(skipped.model), manifests::read_file(run("first").model));
}

TEST_F(TrainingRun, AShardThatIsGoneOrNotListedIsDamage) {
  const auto shards = train_on_dataset({4, 5});
  std::filesystem::rename(shards[1], path("set/shards/other.h5"));
  const std::string text = message([&] { run("out"); });
  EXPECT_THAT(text, HasSubstr(shards[1].string() + ": it is gone"));
  EXPECT_THAT(text, HasSubstr("other.h5: dataset.json does not list it"));
}

TEST_F(TrainingRun, ADamagedDatasetJsonIsRefused) {
  train_on_dataset({4});
  flip_bit(path("set/dataset.json"), 60);
  EXPECT_THAT(message([&] { run("out"); }), HasSubstr(path("set/dataset.json").string()));
}

TEST_F(TrainingRun, AbsurdBoxesAreRefusedOrLeftOutAndNamed) {
  std::vector<manifests::ShardSample> samples;
  for (unsigned i = 0; i < 8; ++i)
    samples.push_back(testing::shard_sample("s/" + std::to_string(i), i, true));
  samples[1].patch_box[2] = 0.0;
  samples[2].patch_box[2] = 1e18;
  samples[4].patch_box[0] = std::nan("");
  samples[5].body.pose[17] = std::nanf("");
  samples[6].crop.resize(40);
  manifests::ShardHeader header;
  header.image_encoding = manifests::ImageEncoding::png;
  manifests::write_shard(path("odd.h5"), header, samples);
  train_on(path("odd.h5").string());
  const std::string text = message([&] { run("out"); });
  for (const char* id : {"s/1: its box", "s/2: its box", "s/4: its box", "s/5: its pose"}) {
    EXPECT_THAT(text, HasSubstr(id));
  }
  const TrainingSummary skipped = run_without_damage("skipped");
  EXPECT_TRUE(skipped.finished);
  ASSERT_EQ(skipped.left_out.size(), 5U);
  EXPECT_THAT(skipped.left_out[4], HasSubstr("s/6: its stored crop cannot be decoded"));
  manifests::write_shard(path("sound.h5"), header, {samples[0], samples[3], samples[7]});
  train_on(path("sound.h5").string());
  EXPECT_EQ(manifests::read_file(skipped.model), manifests::read_file(run("sound").model));
}

TEST_F(TrainingRun, WhatIsLeftOutOfTheHeldOutPoolIsNamedToo) {
  std::vector<manifests::ShardSample> samples;
  for (unsigned i = 0; i < 3; ++i)
    samples.push_back(testing::shard_sample("unseen/" + std::to_string(i), i, true));
  samples[1].patch_box[2] = 0.0;
  manifests::ShardHeader header;
  header.image_encoding = manifests::ImageEncoding::png;
  manifests::write_shard(path("unseen.h5"), header, samples);
  config_.domain = {"rendered", "two shards", "unseen", {"unseen", {path("unseen.h5").string()}, 1.0}, 21};
  EXPECT_THAT(message([&] { run("out"); }), HasSubstr("unseen/1: its box"));
  EXPECT_THAT(run_without_damage("skipped").left_out, ::testing::ElementsAre(HasSubstr("unseen/1: its box")));
}

TEST_F(TrainingRun, ADamagedStateIsRefused) {
  run("out", 2);
  const std::string sound = manifests::read_file(path("out/state.safetensors"));
  const std::string straight = manifests::read_file(run("straight").model);
  int refused = 0;
  for (std::size_t at = 20; at < sound.size(); at += sound.size() / 40) {
    std::filesystem::remove_all(path("copy"));
    manifests::write_file_atomically(
        (std::filesystem::create_directory(path("copy")), path("copy/state.safetensors")), sound);
    flip_bit(path("copy/state.safetensors"), at);
    try {
      EXPECT_EQ(manifests::read_file(run("copy").model), straight) << "byte " << at;
    } catch (const std::exception& error) {
      EXPECT_THAT(error.what(), HasSubstr("copy")) << "byte " << at;
      ++refused;
    }
  }
  EXPECT_GE(refused, 36);
}

}  // namespace
}  // namespace q3d::pipeline::training
