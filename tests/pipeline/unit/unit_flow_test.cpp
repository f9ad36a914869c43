#include "pipeline/unit/unit_flow.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <atomic>
#include <chrono>
#include <stdexcept>
#include <thread>

namespace q3d::pipeline::unit {
namespace {

// A flow over units without candidates that records what happens to each.
class Recorder {
 public:
  explicit Recorder(std::int64_t count) : units_(static_cast<std::size_t>(count)) {
    for (std::int64_t i = 0; i < count; ++i) units_[static_cast<std::size_t>(i)].index = i;
    flow.units = count;
    flow.read = [this](std::int64_t index) {
      ++in_flight;
      most_in_flight = std::max(most_in_flight.load(), in_flight.load());
      auto work = std::make_shared<UnitWork>();
      work->unit = &units_[static_cast<std::size_t>(index)];
      return work;
    };
    flow.decode = [](UnitWork& work) {
      // Later units are quicker, so that they would overtake if nothing kept the order.
      std::this_thread::sleep_for(std::chrono::milliseconds(work.unit->index % 3 == 0 ? 8 : 1));
    };
    flow.compute = [this](UnitWork&) { computing_threads.push_back(std::this_thread::get_id()); };
    flow.encode = [this](UnitWork&) { ++encoded; };
    flow.write = [this](UnitWork& work) {
      written.push_back(work.unit->index);
      --in_flight;
    };
  }

  UnitFlow flow;
  std::atomic<int> in_flight = 0;
  std::atomic<int> most_in_flight = 0;
  std::atomic<int> encoded = 0;
  std::vector<std::thread::id> computing_threads;  // touched by the device thread only
  std::vector<std::int64_t> written;               // touched by the serial writer only

 private:
  std::vector<candidates::Unit> units_;
};

class UnitFlowThreads : public ::testing::TestWithParam<int> {};

TEST_P(UnitFlowThreads, WritesInOrderComputesOnOneThreadAndBoundsWhatIsOpen) {
  const tbb::global_control threads(tbb::global_control::max_allowed_parallelism,
                                    static_cast<std::size_t>(GetParam()));
  Recorder recorder(20);
  recorder.flow.units_in_flight = 3;
  device::DeviceWorker device;
  run_units(recorder.flow, device);
  ASSERT_EQ(recorder.written.size(), 20U);
  EXPECT_EQ(recorder.encoded, 20);
  for (std::int64_t i = 0; i < 20; ++i) EXPECT_EQ(recorder.written[static_cast<std::size_t>(i)], i);
  for (const auto& id : recorder.computing_threads) EXPECT_EQ(id, recorder.computing_threads.front());
  // The source may hold one item ready beyond the limit.
  EXPECT_LE(recorder.most_in_flight, 4);
}

INSTANTIATE_TEST_SUITE_P(Threads, UnitFlowThreads, ::testing::Values(1, 2, 4));

TEST(UnitFlow, AnExceptionOfAnyStepStopsTheRunAndIsRethrown) {
  const std::function<void(UnitWork&)> fails = [](UnitWork& work) {
    if (work.unit->index == 5) throw std::runtime_error("unit 5 broke");
  };
  for (int step = 0; step < 4; ++step) {
    Recorder recorder(50);
    if (step == 0) recorder.flow.decode = fails;
    if (step == 1) recorder.flow.compute = fails;
    if (step == 2) recorder.flow.encode = fails;
    if (step == 3) recorder.flow.write = fails;
    device::DeviceWorker device;
    try {
      run_units(recorder.flow, device);
      FAIL() << "step " << step << " did not throw";
    } catch (const std::runtime_error& error) {
      EXPECT_STREQ(error.what(), "unit 5 broke");
    }
    EXPECT_LT(recorder.written.size(), 50U);
  }
}

TEST(UnitFlow, ARunWithoutEncodingWritesAllTheSame) {
  Recorder recorder(4);
  recorder.flow.encode = nullptr;
  device::DeviceWorker device;
  run_units(recorder.flow, device);
  EXPECT_EQ(recorder.written.size(), 4U);
}

TEST(UnitFlow, ClaimedUnitsAreWrittenInTheOrderOfTheClaims) {
  Recorder recorder(7);
  recorder.flow.claim = [units =
                             std::vector<std::int64_t>{5, 0, 3}]() mutable -> std::optional<std::int64_t> {
    if (units.empty()) return std::nullopt;
    const std::int64_t unit = units.front();
    units.erase(units.begin());
    return unit;
  };
  device::DeviceWorker device;
  run_units(recorder.flow, device);
  EXPECT_EQ(recorder.written, (std::vector<std::int64_t>{5, 0, 3}));
}

TEST(UnitFlow, NoUnitsIsNoWork) {
  Recorder recorder(0);
  device::DeviceWorker device;
  run_units(recorder.flow, device);
  EXPECT_TRUE(recorder.written.empty());
}

TEST(DeviceWorker, RunWaitsAndRethrows) {
  device::DeviceWorker device;
  int value = 0;
  device.run([&] { value = 3; });
  EXPECT_EQ(value, 3);
  EXPECT_THROW(device.run([] { throw std::runtime_error("x"); }), std::runtime_error);
}

}  // namespace
}  // namespace q3d::pipeline::unit
