// Files of checked lines, which a killed process may leave half written: j journals, d the cache of digests,
// p the pictures' hashes. Each file is read as it is, and once more with a right checksum at each line.
#include <filesystem>
#include <string>

#include "manifests/atomic_file.h"
#include "manifests/checked_line.h"
#include "manifests/digest.h"
#include "manifests/durability.h"
#include "manifests/journal.h"
#include "manifests/known_files.h"
#include "manifests/next_field.h"
#include "pipeline/leakage/picture_hashes.h"
#include "tests/fuzz/fuzz_input.h"

namespace {

using q3d::fuzz::require;
namespace fs = std::filesystem;
namespace manifests = q3d::manifests;

std::string sealed_lines(std::string_view text) {
  std::string sealed;
  while (!text.empty()) sealed += manifests::seal_line(manifests::next_field(text, '\n'));
  return sealed;
}

bool are_equal(const manifests::JournalEntry& a, const manifests::JournalEntry& b) {
  return a.unit == b.unit && a.input_digest == b.input_digest && a.file == b.file && a.sha256 == b.sha256 &&
         a.bytes == b.bytes && a.rows == b.rows;
}

void read_journal(const fs::path& file) {
  manifests::Journal journal(file);
  for (const auto& [unit, entry] : journal.entries()) {
    require((file.parent_path() / entry.file)
                .lexically_normal()
                .string()
                .starts_with(file.parent_path().string()),
            "a unit's file lies in the journal's folder", entry.file);
    require(entry.file.find('\0') == std::string::npos, "a file's name has no NUL", entry.file);
    require(unit == entry.unit && journal.find(unit, entry.input_digest).has_value(), "an entry is found");
  }
  const auto before = journal.entries();
  journal.write_anew();
  const manifests::Journal again(file);
  require(again.damaged_lines().empty() && !again.dropped_torn_line(),
          "a journal that was written anew is sound");
  require(std::equal(before.begin(), before.end(), again.entries().begin(), again.entries().end(),
                     [](const auto& a, const auto& b) { return are_equal(a.second, b.second); }),
          "a journal survives being written");
}

void read_digests(const fs::path& file) {
  const std::size_t known = manifests::read_known_files(file).size();
  manifests::DigestCache(file).save();
  const std::string saved = manifests::read_file(file);
  manifests::DigestCache(file).save();
  require(manifests::read_file(file) == saved, "the cache survives being written", saved);
  require(manifests::read_known_files(file).size() <= known, "no digest comes from nowhere", saved);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  q3d::manifests::set_durability({.syncs = false, .locks = true});  // syncs would take most of the time
  static const q3d::fuzz::Scratch scratch;
  const auto [reader, bytes] = q3d::fuzz::chosen_reader(data, size);
  for (const std::string& text : {std::string(bytes), sealed_lines(bytes)}) {
    if (reader == 'j') read_journal(scratch.write("journal.jsonl", text));
    if (reader == 'd') read_digests(scratch.write("digests.txt", text));
    if (reader == 'p') q3d::pipeline::leakage::PictureHashes hashes(scratch.write("hashes.txt", text));
  }
  return 0;
}
