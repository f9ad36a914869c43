#include "pipeline/leakage/exclusions.h"

#include <fmt/format.h>

#include <map>
#include <utility>

#include "manifests/valid_utf8.h"
#include "pipeline/leakage/leakage.h"
#include "pipeline/leakage/leakage_lists.h"

namespace q3d::pipeline::leakage {
namespace {

using manifests::Reason;

void leave_out_leaks(const config::BuildConfig& config, manifests::DigestCache& digests,
                     const std::filesystem::path& out, bool quiet, candidates::Ingest& ingest) {
  if (!config.leakage) return;
  LeakageReport report = find_leaks(*config.leakage, ingest, digests, out, quiet);
  write_leakage_lists(out, report, ingest);
  std::size_t others = 0;
  for (const Leak& leak : report.leaks) {
    if (ingest.candidates.at(leak.candidate).role != config::Role::pseudo) {
      ++others;
      continue;
    }
    ingest.candidates.exclude(leak.candidate, {Reason::in_test_split,
                                               fmt::format("its picture is that of {} ({}: {})", leak.test_id,
                                                           to_string(leak.evidence), leak.detail)});
    ++report.summary.excluded;
  }
  const auto note = [&](std::string text) {
    ingest.notes.push_back({loaders::formats::NoteKind::remark, {}, std::move(text)});
  };
  for (const std::string& text : report.notes) note(text);
  note(fmt::format("leakage: {} pseudo labels are left out, since their picture is in a test set",
                   report.summary.excluded));
  if (others > 0) {
    note(fmt::format(
        "leakage: {} samples that bring their own labels have a picture of a test set too, and are kept "
        "(leaks.csv in the output folder lists them)",
        others));
  }
  if (report.summary.groups > 0) {
    note(
        fmt::format("leakage: {} pictures of the pool look like another, in {} groups, and are kept "
                    "(duplicates.csv in the output folder lists them)",
                    report.summary.in_groups, report.summary.groups));
  }
  ingest.leakage = std::move(report.summary);
}

// A veto overrides leakage, because the user decided explicitly.
void apply_veto(const std::filesystem::path& file, candidates::Ingest& ingest) {
  if (file.empty()) return;
  candidates::Veto& veto = ingest.veto.emplace(candidates::read_veto(file));
  std::map<std::size_t, candidates::Exclusion> vetoed;
  ingest.candidates.for_each([&](std::size_t i, const candidates::Candidate& candidate) {
    const auto found = veto.reasons.find(candidate.record.id);
    if (found != veto.reasons.end()) vetoed[i] = {Reason::vetoed, found->second};
  });
  for (auto& [index, exclusion] : vetoed) ingest.candidates.exclude(index, std::move(exclusion));
  veto.matched = vetoed.size();
  if (veto.matched < veto.reasons.size()) {
    ingest.notes.push_back({loaders::formats::NoteKind::caution,
                            {},
                            fmt::format("veto {}: {} of its {} ids are no candidate's",
                                        manifests::valid_utf8(file.filename().string()),
                                        veto.reasons.size() - veto.matched, veto.reasons.size())});
  }
}

// An exclusion changes a unit's labels, not its predictions.
void digest_exclusions(candidates::Ingest& ingest) {
  auto next = ingest.candidates.exclusions().begin();
  const auto end = ingest.candidates.exclusions().end();
  for (candidates::Unit& unit : ingest.units) {
    std::string text;
    for (; next != end && next->first < unit.first + unit.count; ++next) {
      text += fmt::format("{} {} {}\n", next->first - unit.first, manifests::to_string(next->second.reason),
                          next->second.detail);
    }
    if (!text.empty()) unit.label_digest = manifests::sha256(unit.label_digest + '\n' + text);
  }
}

}  // namespace

void leave_out(const config::BuildConfig& config, manifests::DigestCache& digests,
               const std::filesystem::path& out, bool quiet, candidates::Ingest& ingest) {
  leave_out_leaks(config, digests, out, quiet, ingest);
  apply_veto(config.veto, ingest);
  digests.save();
  digest_exclusions(ingest);
}

}  // namespace q3d::pipeline::leakage
