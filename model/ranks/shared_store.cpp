#include "model/ranks/shared_store.h"

#include "model/ranks/tcp_store.h"

namespace q3d::model::ranks {
namespace {

// Adds the rank and the store to the message of an error, because all ranks write to one terminal.
template <typename Question>
auto asked(const RankPlace& place, Question&& question) {
  try {
    return question();
  } catch (const std::exception& error) {
    throw StoreLost(fmt::format(
        "rank {} of {}: the store at {}:{}, by which the ranks share the work, does not answer: {}",
        place.rank, place.size, place.master_address, place.master_port, first_line(error)));
  }
}

class TcpStore : public SharedStore {
 public:
  TcpStore(const RankPlace& place, const std::string& purpose)
      : place_(place), store_(open_tcp_store(place, purpose, Gathering::loose)) {
    store_->setTimeout(place.answer_timeout);
  }

  std::int64_t add(const std::string& key, std::int64_t value) override {
    return asked(place_, [&] { return store_->add(key, value); });
  }
  void set(const std::string& key, const std::string& value) override {
    asked(place_, [&] { store_->set(key, value); });
  }
  std::optional<std::string> get(const std::string& key) override {
    return asked(place_, [&]() -> std::optional<std::string> {
      if (!store_->check({key})) return std::nullopt;
      return store_->get_to_str(key);
    });
  }
  std::vector<std::string> get_all(const std::vector<std::string>& keys) override {
    return asked(place_, [&] {
      std::vector<std::string> texts;
      for (const auto& value : store_->multiGet(keys)) texts.emplace_back(value.begin(), value.end());
      return texts;
    });
  }

 private:
  RankPlace place_;
  c10::intrusive_ptr<c10d::Store> store_;
};

}  // namespace

std::unique_ptr<SharedStore> open_shared_store(const RankPlace& place, const std::string& purpose) {
  try {
    return std::make_unique<TcpStore>(place, purpose);
  } catch (const std::exception& error) {
    throw std::runtime_error(
        fmt::format("rank {} of {}: the store of the ranks at {}:{} was not reached within {} "
                    "s: {}",
                    place.rank, place.size, place.master_address, place.master_port,
                    place.join_timeout.count(), first_line(error)));
  }
}

}  // namespace q3d::model::ranks
