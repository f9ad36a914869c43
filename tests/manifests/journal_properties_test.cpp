// A journal that a kill cut anywhere holds the entries of the lines that are whole, and no others.
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "manifests/atomic_file.h"
#include "manifests/journal.h"
#include "tests/support/paths.h"
#include "tests/support/properties.h"

namespace q3d::manifests {
namespace {

bool equal(const JournalEntry& a, const JournalEntry& b) {
  return a.unit == b.unit && a.input_digest == b.input_digest && a.file == b.file && a.sha256 == b.sha256 &&
         a.bytes == b.bytes && a.rows == b.rows;
}

// Few unit numbers, so that later entries of a unit replace earlier ones.
JournalEntry any_entry() {
  JournalEntry entry;
  entry.unit = *rc::gen::inRange<std::int64_t>(0, 4);
  entry.input_digest = *testing::awkward_text();
  entry.file = *rc::gen::element<std::string>("", "unit.h5", "żubr \"1\".h5", "folder/unit.h5");
  entry.sha256 = *testing::awkward_text();
  entry.bytes = *rc::gen::arbitrary<std::int64_t>();
  entry.rows = *rc::gen::arbitrary<std::int64_t>();
  return entry;
}

std::vector<JournalEntry> any_entries() {
  std::vector<JournalEntry> entries(*rc::gen::inRange<std::size_t>(1, 6));
  std::generate(entries.begin(), entries.end(), any_entry);
  return entries;
}

// The latest entry of each unit among the first `count`.
std::map<std::int64_t, JournalEntry> latest(const std::vector<JournalEntry>& entries, std::size_t count) {
  std::map<std::int64_t, JournalEntry> by_unit;
  for (std::size_t i = 0; i < count; ++i) by_unit.insert_or_assign(entries[i].unit, entries[i]);
  return by_unit;
}

void assert_holds(const Journal& journal, const std::map<std::int64_t, JournalEntry>& expected) {
  RC_ASSERT(journal.entries().size() == expected.size());
  for (const auto& [unit, entry] : expected) {
    RC_ASSERT(journal.entries().contains(unit));
    RC_ASSERT(equal(journal.entries().at(unit), entry));
  }
}

// Writes the entries and returns the file's size after each.
std::vector<std::size_t> append_all(const std::filesystem::path& path,
                                    const std::vector<JournalEntry>& entries) {
  std::filesystem::remove(path);
  Journal journal(path);
  std::vector<std::size_t> ends;
  for (const JournalEntry& entry : entries) {
    journal.append(entry);
    ends.push_back(std::filesystem::file_size(path));
  }
  return ends;
}

RC_GTEST_PROP(JournalProperties, AKillAtAnyByteLeavesThePrefixOfWholeLines, ()) {
  const testing::ScratchDir scratch;
  const auto path = scratch.path() / "journal";
  const std::vector<JournalEntry> entries = any_entries();
  const std::vector<std::size_t> ends = append_all(path, entries);
  const std::string whole = read_file(path);

  const std::size_t cut = *rc::gen::inRange<std::size_t>(0, whole.size() + 1);
  std::filesystem::resize_file(path, cut);
  const auto after_cut = std::upper_bound(ends.begin(), ends.end(), cut);
  const auto kept = static_cast<std::size_t>(after_cut - ends.begin());
  const std::size_t whole_bytes = kept == 0 ? 0 : ends[kept - 1];

  Journal journal(path);
  assert_holds(journal, latest(entries, kept));
  RC_ASSERT(journal.dropped_torn_line() == (cut != whole_bytes));

  // The next line that is appended stands where the torn line began.
  std::vector<JournalEntry> continued(entries.begin(), entries.begin() + static_cast<std::ptrdiff_t>(kept));
  continued.push_back(any_entry());
  journal.append(continued.back());
  RC_ASSERT(read_file(path).substr(0, whole_bytes) == whole.substr(0, whole_bytes));
  const Journal again(path);
  RC_ASSERT(!again.dropped_torn_line());
  assert_holds(again, latest(continued, continued.size()));
}

// A line with a wrong byte is never taken for an entry, and it is told: as a damaged line where another
// follows, as a torn one at the file's end. The other lines stay.
RC_GTEST_PROP(JournalProperties, AChangedByteIsNoticed, ()) {
  const testing::ScratchDir scratch;
  const auto path = scratch.path() / "journal";
  const std::vector<JournalEntry> entries = any_entries();
  const std::vector<std::size_t> ends = append_all(path, entries);
  const std::string whole = read_file(path);
  std::string damaged = whole;
  const std::size_t at = *rc::gen::inRange<std::size_t>(0, whole.size());
  damaged[at] = static_cast<char>(damaged[at] ^ *rc::gen::inRange(1, 256));
  std::ofstream(path, std::ios::binary) << damaged;

  const auto line = static_cast<std::size_t>(std::upper_bound(ends.begin(), ends.end(), at) - ends.begin());
  const std::size_t lost = whole[at] == '\n' ? 2 : 1;  // without its end a line runs into the next
  std::vector<JournalEntry> sound(entries.begin(), entries.begin() + static_cast<std::ptrdiff_t>(line));
  for (std::size_t i = line + lost; i < entries.size(); ++i) sound.push_back(entries[i]);
  const Journal journal{path};
  RC_ASSERT(journal.dropped_torn_line() || !journal.damaged_lines().empty());
  assert_holds(journal, latest(sound, sound.size()));
}

}  // namespace
}  // namespace q3d::manifests
