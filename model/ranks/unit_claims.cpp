#include "model/ranks/unit_claims.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <utility>

namespace q3d::model::ranks {
namespace {

constexpr const char* kNext = "next";  // the counter of units that were given away

bool contains(const std::vector<std::int64_t>& units, std::int64_t unit) {
  return std::find(units.begin(), units.end(), unit) != units.end();
}

}  // namespace

struct UnitClaims::Word {
  struct Open {
    std::int64_t unit = 0;
    int of = -1;
    ClaimSeconds age{0.0};
  };
  std::int64_t beats = -1;  // a rank that has not come yet
  bool is_claiming = false;
  bool has_left = false;
  std::vector<Open> open;
  std::vector<std::int64_t> copied;
  ClaimSeconds longest{0.0};
  Tally tally{};

  bool has_open(std::int64_t unit) const {
    return std::any_of(open.begin(), open.end(), [&](const Open& each) { return each.unit == unit; });
  }
};

ClaimRules claim_rules(int ranks) {
  ClaimRules rules;
  rules.beat = ClaimSeconds(1.0 + ranks / 200.0);
  return rules;
}

UnitClaims::UnitClaims(SharedStore& store, int rank, int ranks, ClaimRules rules, Now now)
    : store_(store), rank_(rank), ranks_(ranks), rules_(rules), now_(std::move(now)) {
  for (int each = 0; each < ranks; ++each) keys_.push_back(fmt::format("rank/{}", each));
}

void UnitClaims::prepare() {
  for (int each = 0; each < ranks_; ++each) {
    if (each != rank_) store_.set(keys_[static_cast<std::size_t>(each)], "");
  }
  beat();
}

void UnitClaims::beat() {
  store_.set(keys_[static_cast<std::size_t>(rank_)], own_word());
}

std::string UnitClaims::own_word() {
  const std::lock_guard lock(mutex_);
  nlohmann::json open = nlohmann::json::array();
  for (const OpenUnit& each : open_) {
    open.push_back({each.unit, each.of, ClaimSeconds(now_() - each.since).count()});
  }
  return nlohmann::json{{"beats", ++beats_}, {"claiming", is_claiming_}, {"left", has_left_},
                        {"open", open},      {"copied", copied_},        {"longest", longest_.count()},
                        {"tally", tally_}}
      .dump();
}

UnitClaims::Word UnitClaims::read_word(const std::string& text) {
  Word word;
  if (text.empty()) return word;
  const nlohmann::json json = nlohmann::json::parse(text);
  word.beats = json.at("beats").get<std::int64_t>();
  word.is_claiming = json.at("claiming").get<bool>();
  word.has_left = json.at("left").get<bool>();
  for (const nlohmann::json& open : json.at("open")) {
    word.open.push_back(
        {open.at(0).get<std::int64_t>(), open.at(1).get<int>(), ClaimSeconds(open.at(2).get<double>())});
  }
  word.copied = json.at("copied").get<std::vector<std::int64_t>>();
  word.longest = ClaimSeconds(json.at("longest").get<double>());
  word.tally = json.at("tally").get<Tally>();
  return word;
}

// The caller holds the mutex.
void UnitClaims::watch(int rank, const Word& word) {
  Sign& sign = signs_[rank];
  if (std::exchange(sign.beats, word.beats) != word.beats || word.beats < 0) sign.changed = now_();
}

std::vector<UnitClaims::Word> UnitClaims::read_words() {
  std::vector<Word> words;
  for (const std::string& text : store_.get_all(keys_)) words.push_back(read_word(text));
  const std::lock_guard lock(mutex_);
  for (int rank = 0; rank < ranks_; ++rank) watch(rank, words[static_cast<std::size_t>(rank)]);
  return words;
}

// The caller holds the mutex.
bool UnitClaims::is_lost(int rank, const Word& word) const {
  if (word.has_left) return true;
  return now_() - signs_.at(rank).changed > rules_.beat * rules_.lost_after_beats;
}

std::optional<std::int64_t> UnitClaims::next(std::int64_t units) {
  bool is_idle = false;
  {
    const std::lock_guard lock(mutex_);
    is_idle = open_.empty();
  }
  const std::int64_t given = store_.add(kNext, 0);
  if (given >= units || (!is_idle && units - given <= ranks_)) return std::nullopt;
  // The other ranks are told before the counter moves, so that none of them takes the unit for finished in
  // between.
  {
    const std::lock_guard lock(mutex_);
    is_claiming_ = true;
  }
  beat();
  const std::int64_t unit = store_.add(kNext, 1) - 1;
  {
    const std::lock_guard lock(mutex_);
    is_claiming_ = false;
    if (unit < units) open_.push_back({unit, -1, now_()});
  }
  beat();
  return unit < units ? std::optional(unit) : std::nullopt;
}

UnitClaims::Remainder UnitClaims::remainder() {
  const std::vector<Word> words = read_words();
  ClaimSeconds longest{0.0};
  std::vector<std::int64_t> copied;
  for (const Word& word : words) {
    longest = std::max(longest, word.longest);
    copied.insert(copied.end(), word.copied.begin(), word.copied.end());
  }
  {
    // This rank compares with its own times, because they show how fast it would make the unit itself.
    const std::lock_guard lock(mutex_);
    if (longest_.count() > 0.0) longest = longest_;
  }
  const ClaimSeconds slow = std::max(rules_.least_slow, longest * rules_.slow_factor);
  Remainder result{std::nullopt, true};
  for (int rank = 0; rank < ranks_; ++rank) {
    const Word& word = words[static_cast<std::size_t>(rank)];
    if (rank == rank_ || word.beats < 0) continue;
    const bool lost = [&] {
      const std::lock_guard lock(mutex_);
      return is_lost(rank, word);
    }();
    if (word.is_claiming && !lost) result.is_finished = false;
    for (const Word::Open& open : word.open) {
      if (contains(copied, open.unit)) continue;
      // A second making of a unit whose first one has come to its end.
      if (open.of >= 0 && !words[static_cast<std::size_t>(open.of)].has_open(open.unit)) continue;
      result.is_finished = false;
      if (!lost && open.age < slow) continue;
      // Each opening of a unit is copied once.
      if (store_.add(fmt::format("copy/{}/{}", open.unit, rank), 1) != 1) continue;
      {
        const std::lock_guard lock(mutex_);
        open_.push_back({open.unit, rank, now_()});
      }
      beat();
      result.unit = open.unit;
      return result;
    }
  }
  return result;
}

void UnitClaims::finish(std::int64_t unit, const Tally& tally) {
  {
    const std::lock_guard lock(mutex_);
    const auto found =
        std::find_if(open_.begin(), open_.end(), [&](const OpenUnit& open) { return open.unit == unit; });
    if (found == open_.end()) return;
    longest_ = std::max(longest_, ClaimSeconds(now_() - found->since));
    if (found->of >= 0) copied_.push_back(unit);
    open_.erase(found);
    for (std::size_t i = 0; i < tally.size(); ++i) tally_[i] += tally[i];
  }
  beat();
}

void UnitClaims::leave() {
  {
    const std::lock_guard lock(mutex_);
    has_left_ = true;
  }
  beat();
}

bool UnitClaims::has_gone(int rank) {
  const std::optional<std::string> text = store_.get(keys_[static_cast<std::size_t>(rank)]);
  if (!text) return false;
  const Word word = read_word(*text);
  const std::lock_guard lock(mutex_);
  watch(rank, word);
  return word.beats >= 0 && is_lost(rank, word);
}

bool UnitClaims::have_all_left() {
  const std::vector<Word> words = read_words();
  for (int rank = 0; rank < ranks_; ++rank) {
    if (rank != rank_ && !words[static_cast<std::size_t>(rank)].has_left) return false;
  }
  return true;
}

Tally UnitClaims::others() {
  Tally sum{};
  const std::vector<Word> words = read_words();
  for (int rank = 0; rank < ranks_; ++rank) {
    if (rank == rank_) continue;
    for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += words[static_cast<std::size_t>(rank)].tally[i];
  }
  return sum;
}

}  // namespace q3d::model::ranks
