#include "pipeline/unit/unit_flow.h"

#include <tbb/flow_graph.h>

#include <atomic>
#include <exception>
#include <mutex>

#include "pipeline/run/interrupt.h"

namespace q3d::pipeline::unit {
namespace {

using Item = std::shared_ptr<UnitWork>;

// The first exception of any node; once there is one, items pass through untouched so that the graph drains.
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
  tf::input_node<Item> read(graph, [&](tbb::flow_control& control) -> Item {
    Item item;
    if (next < flow.units) failure.guard([&] { item = flow.read(next++); });
    if (!item) control.stop();
    return item;
  });
  tf::limiter_node<Item> in_flight(graph, static_cast<std::size_t>(flow.units_in_flight));
  tf::function_node<Item, Item> decode(graph, tf::unlimited, [&](const Item& item) {
    failure.guard([&] { flow.decode(*item); });
    return item;
  });
  DeviceNode compute(graph, tf::unlimited, [&](const Item& item, DeviceNode::gateway_type& gateway) {
    gateway.reserve_wait();
    device.post([&, item] {
      failure.guard([&] { flow.compute(*item); });
      gateway.try_put(item);
      gateway.release_wait();
    });
  });
  tf::function_node<Item, Item> encode(graph, tf::unlimited, [&](const Item& item) {
    failure.guard([&] {
      if (flow.encode) flow.encode(*item);
    });
    return item;
  });
  tf::sequencer_node<Item> in_order(
      graph, [](const Item& item) { return static_cast<std::size_t>(item->unit->index); });
  tf::function_node<Item, tf::continue_msg> write(graph, tf::serial, [&](const Item& item) {
    failure.guard([&] { flow.write(*item); });
    item->decoded.clear();
    return tf::continue_msg();
  });

  tf::make_edge(read, in_flight);
  tf::make_edge(in_flight, decode);
  tf::make_edge(decode, compute);
  tf::make_edge(compute, encode);
  tf::make_edge(encode, in_order);
  tf::make_edge(in_order, write);
  tf::make_edge(write, in_flight.decrementer());
  read.activate();
  graph.wait_for_all();

  failure.rethrow();
  run::throw_if_interrupted();
}

}  // namespace q3d::pipeline::unit
