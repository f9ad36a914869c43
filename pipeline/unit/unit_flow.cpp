#include "pipeline/unit/unit_flow.h"

#include <tbb/flow_graph.h>

#include <atomic>
#include <exception>
#include <mutex>
#include <optional>

#include "pipeline/run/interrupt.h"

namespace q3d::pipeline::unit {
namespace {

// A unit and its turn. The turns are in the order of the claims, in which units need not be in order.
struct Turn {
  std::size_t number = 0;
  std::shared_ptr<UnitWork> work;
};
using Item = std::shared_ptr<Turn>;

// Holds the first exception of any node. Once there is one, items pass through the nodes unchanged, so that
// the graph drains.
class FirstFailure {
 public:
  template <typename Step>
  void guard(Step&& step) {
    if (stopping()) return;
    try {
      step();
    } catch (...) {
      const std::lock_guard lock(mutex_);
      if (!failure_) failure_ = std::current_exception();
      failed_ = true;
    }
  }
  bool stopping() const { return failed_ || run::interrupted(); }
  void rethrow() const {
    if (failure_) std::rethrow_exception(failure_);
  }

 private:
  std::mutex mutex_;
  std::exception_ptr failure_;
  std::atomic<bool> failed_ = false;
};

}  // namespace

void run_units(const UnitFlow& flow, device::DeviceWorker& device) {
  namespace tf = tbb::flow;
  using DeviceNode = tf::async_node<Item, Item>;
  FirstFailure failure;
  tf::graph graph;

  std::int64_t next = 0;
  const auto in_order = [&]() -> std::optional<std::int64_t> {
    return next < flow.units ? std::optional(next++) : std::nullopt;
  };
  std::size_t turns = 0;
  tf::input_node<Item> read(graph, [&](tbb::flow_control& control) -> Item {
    Item item;
    failure.guard([&] {
      const std::optional<std::int64_t> unit = flow.claim ? flow.claim() : in_order();
      if (unit) item = std::make_shared<Turn>(Turn{turns++, flow.read(*unit)});
    });
    if (!item) control.stop();
    return item;
  });
  tf::limiter_node<Item> in_flight(graph, static_cast<std::size_t>(flow.units_in_flight));
  tf::function_node<Item, Item> decode(graph, tf::unlimited, [&](const Item& item) {
    failure.guard([&] { flow.decode(*item->work); });
    return item;
  });
  DeviceNode compute(graph, tf::unlimited, [&](const Item& item, DeviceNode::gateway_type& gateway) {
    gateway.reserve_wait();
    device.post([&, item] {
      failure.guard([&] { flow.compute(*item->work); });
      gateway.try_put(item);
      gateway.release_wait();
    });
  });
  tf::function_node<Item, Item> encode(graph, tf::unlimited, [&](const Item& item) {
    failure.guard([&] {
      if (flow.encode) flow.encode(*item->work);
    });
    return item;
  });
  tf::sequencer_node<Item> by_turn(graph, [](const Item& item) { return item->number; });
  tf::function_node<Item, tf::continue_msg> write(graph, tf::serial, [&](const Item& item) {
    failure.guard([&] { flow.write(*item->work); });
    item->work->decoded.clear();
    return tf::continue_msg();
  });

  tf::make_edge(read, in_flight);
  tf::make_edge(in_flight, decode);
  tf::make_edge(decode, compute);
  tf::make_edge(compute, encode);
  tf::make_edge(encode, by_turn);
  tf::make_edge(by_turn, write);
  tf::make_edge(write, in_flight.decrementer());
  read.activate();
  graph.wait_for_all();

  failure.rethrow();
  run::throw_if_interrupted();
}

}  // namespace q3d::pipeline::unit
