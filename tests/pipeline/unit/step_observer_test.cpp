#include "pipeline/unit/step_observer.h"

#include <gmock/gmock.h>

#include <string>
#include <vector>

#include "pipeline/unit/predict.h"
#include "pipeline/unit/refine.h"

namespace q3d::pipeline::unit {
namespace {

using ::testing::ElementsAre;

// Remembers how many elements each call had. Predictions miss every keypoint by 0.25.
class CountingNetwork : public device::Network {
 public:
  std::vector<device::BodyPrediction> predict(std::span<const device::PatchView> patches,
                                              std::vector<device::KeptFeatures>* features) override {
    calls.push_back(patches.size());
    if (features != nullptr) {
      for (const device::PatchView& patch : patches)
        features->push_back(std::make_shared<Seen>(patch.data()));
    }
    std::vector<device::BodyPrediction> bodies(patches.size());
    for (device::BodyPrediction& body : bodies) body.keypoints_2d.fill({0.25F, 0.25F});
    return bodies;
  }
  std::vector<device::AdaptOutcome> adapt(std::span<const device::AdaptRequest> requests,
                                          const std::vector<int>& /*snapshots*/,
                                          const std::function<void(std::size_t)>& progress) override {
    calls.push_back(requests.size());
    for (const device::AdaptRequest& request : requests) {
      const auto* seen = dynamic_cast<const Seen*>(request.features.get());
      with_own_features += seen != nullptr && seen->patch == request.patch.data() ? 1 : 0;
    }
    if (progress) progress(1);
    std::vector<device::AdaptOutcome> outcomes(requests.size());
    for (device::AdaptOutcome& outcome : outcomes) outcome.curve = {0.25, 0.125};
    return outcomes;
  }
  const std::string& device_description() const override { return name_; }
  const std::string& device_warning() const override { return name_; }

  std::vector<std::size_t> calls;
  int with_own_features = 0;  // requests that came with the features of their own picture

 private:
  struct Seen : device::PictureFeatures {
    explicit Seen(const std::uint8_t* of) : patch(of) {}
    const std::uint8_t* patch;
  };
  std::string name_;
};

class Recorder : public StepObserver {
 public:
  void predicted(const UnitWork& /*work*/, std::size_t position, const PredictedSample& /*sample*/) override {
    positions.push_back(position);
  }
  void refined(const UnitWork& /*work*/, const RefinedSample& sample) override {
    positions.push_back(sample.sample);
  }
  void batch_done(const UnitWork& /*work*/, std::string_view step, std::size_t done,
                  std::size_t total) override {
    batches.push_back(std::string(step) + " " + std::to_string(done) + "/" + std::to_string(total));
  }

  std::vector<std::size_t> positions;
  std::vector<std::string> batches;
};

// Five candidates, of which the second has failed.
class StepObservers : public ::testing::Test {
 protected:
  StepObservers() {
    candidates_.resize(5);
    for (candidates::Candidate& candidate : candidates_) {
      candidate.record.dataset = "d";
      candidate.record.box = {0, 0, 256, 256};
      candidate.record.keypoints[0] = {128.0, 128.0, 1.0F, 1.0F};
    }
    candidates_[1].record.failure = manifests::Reason::image_missing;
    set_candidates(work_, candidates_);
    work_.decoded.resize(5);
    for (DecodedSample& decoded : work_.decoded) decoded.patch.resize(3);
    rules_.thresholds["d"].tau_low = 0.125;
    rules_.thresholds["d"].tau_high = 0.5;
  }

  std::vector<candidates::Candidate> candidates_;
  UnitWork work_;
  config::JudgingRules rules_;
  CountingNetwork network_;
  Recorder recorder_;
  NetworkSource source_ = [this]() -> device::Network& { return network_; };
};

TEST_F(StepObservers, AreToldAfterEachBatch) {
  predict_unit(work_, source_, {&recorder_, 3});
  EXPECT_THAT(network_.calls, ElementsAre(3, 1));
  EXPECT_THAT(recorder_.positions, ElementsAre(1, 0, 2, 3, 4));
  EXPECT_THAT(recorder_.batches, ElementsAre("predict 3/4", "predict 4/4"));

  network_.calls.clear();
  recorder_.positions.clear();
  recorder_.batches.clear();
  refine_unit(work_, source_, rules_, &recorder_);
  EXPECT_THAT(network_.calls, ElementsAre(4)) << "the network keeps its batch full by itself";
  EXPECT_THAT(recorder_.positions, ElementsAre(0, 2, 3, 4));
  EXPECT_THAT(recorder_.batches, ElementsAre("refine 1/4", "refine 4/4"));
  for (const RefinedSample& sample : *work_.refined) EXPECT_THAT(sample.curve, ElementsAre(0.25, 0.125));
}

TEST_F(StepObservers, WithoutOneTheNetworkGetsAllAtOnce) {
  predict_unit(work_, source_);
  refine_unit(work_, source_, rules_);
  EXPECT_THAT(network_.calls, ElementsAre(4, 4));
}

// A picture is encoded once in a run in one go. A resumed run has no features.
TEST_F(StepObservers, FeaturesOfAdaptedCandidatesAreKept) {
  rules_.thresholds["d"].tau_high = 0.25;  // the predictions' error: nothing is adapted
  predict_unit(work_, source_, {&recorder_, 3}, &rules_);
  EXPECT_THAT(work_.features, ElementsAre(nullptr, nullptr, nullptr, nullptr, nullptr));
  rules_.thresholds["d"].tau_high = 0.5;
  work_.predicted.reset();
  predict_unit(work_, source_, {&recorder_, 3}, &rules_);
  refine_unit(work_, source_, rules_);
  EXPECT_EQ(network_.with_own_features, 4);
  EXPECT_TRUE(work_.features.empty());
  work_.refined.reset();
  refine_unit(work_, source_, rules_);
  EXPECT_EQ(network_.with_own_features, 4);
}

}  // namespace
}  // namespace q3d::pipeline::unit
