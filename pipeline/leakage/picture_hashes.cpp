#include "pipeline/leakage/picture_hashes.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <charconv>
#include <fstream>
#include <set>
#include <stdexcept>
#include <string_view>

#include "loaders/pictures/image.h"
#include "loaders/pictures/orientation.h"
#include "loaders/pictures/perceptual_hash.h"
#include "manifests/atomic_file.h"
#include "manifests/checked_line.h"
#include "manifests/next_field.h"
#include "pipeline/candidates/digested_file.h"
#include "pipeline/run/interrupt.h"
#include "pipeline/run/progress.h"

namespace q3d::pipeline::leakage {
namespace {

using manifests::PictureHash;

// Change this name when the hash of a picture changes. Lines of another method are dropped.
constexpr std::string_view kMethod = "dct1";

constexpr std::size_t kBlock = 4096;  // pictures between two writes of the file

constexpr std::size_t kShaDigits = 64;
constexpr std::size_t kHashDigits = 16;

// Returns "dct1 <key> <upright> <mirrored>", or "dct1 <key> -" for a picture without a hash.
std::string line_of(const std::string& key, const std::optional<PictureHash>& hash) {
  if (!hash) return fmt::format("{} {} -", kMethod, key);
  return fmt::format("{} {} {:016x} {:016x}", kMethod, key, hash->upright, hash->mirrored);
}

bool parse_hash(std::string_view digits, std::uint64_t& hash) {
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), hash, 16);
  return error == std::errc() && end == digits.data() + digits.size();
}

std::optional<PictureHash> hash_file(const PictureFile& picture) {
  const loaders::pictures::DecodedImage image =
      loaders::pictures::decode_image(std::filesystem::path(picture.path));
  candidates::require_as_digested({picture.path, image.sha256, image.failure, image.detail}, picture.sha256);
  if (image.failure != manifests::Reason::none) return std::nullopt;
  return loaders::pictures::perceptual_hash(loaders::pictures::turned(image.rgb, picture.orientation));
}

}  // namespace

std::string PictureFile::key() const {
  return orientation == 1 ? sha256 : fmt::format("{}o{}", sha256, orientation);
}

PictureHashes::PictureHashes(std::filesystem::path file) : file_(std::move(file)) {
  if (!std::filesystem::exists(file_)) return;
  const std::string content = manifests::read_file(file_);
  const std::size_t prefix = kMethod.size() + 1;
  std::string_view rest = content;
  while (!rest.empty()) {
    const auto payload = manifests::open_line(manifests::next_field(rest, '\n'));
    if (!payload || !payload->starts_with(kMethod) || payload->size() < prefix + kShaDigits + 2) continue;
    const std::size_t key_end = payload->find(' ', prefix);
    if (key_end == std::string_view::npos || key_end - prefix < kShaDigits) continue;
    const std::string key(payload->substr(prefix, key_end - prefix));
    const std::string_view hashes = payload->substr(key_end + 1);
    PictureHash hash;
    if (hashes == "-") {
      hashes_[key] = std::nullopt;
    } else if (hashes.size() == 2 * kHashDigits + 1 &&
               parse_hash(hashes.substr(0, kHashDigits), hash.upright) &&
               parse_hash(hashes.substr(kHashDigits + 1), hash.mirrored)) {
      hashes_[key] = hash;
    }
  }
}

void PictureHashes::add(const std::vector<PictureFile>& pictures, bool quiet) {
  std::vector<const PictureFile*> fresh;
  std::set<std::string> seen;
  for (const PictureFile& picture : pictures) {
    const std::string key = picture.key();
    if (hashes_.count(key) == 0 && seen.insert(key).second) fresh.push_back(&picture);
  }
  if (fresh.empty()) return;
  run::Progress progress("pictures hashed", static_cast<std::int64_t>(fresh.size()), quiet);
  for (std::size_t first = 0; first < fresh.size(); first += kBlock) {
    const std::vector<const PictureFile*> block(
        fresh.begin() + static_cast<std::ptrdiff_t>(first),
        fresh.begin() + static_cast<std::ptrdiff_t>(std::min(first + kBlock, fresh.size())));
    std::vector<std::optional<PictureHash>> made(block.size());
    tbb::parallel_for(std::size_t{0}, block.size(), [&](std::size_t i) {
      if (run::interrupted()) return;
      made[i] = hash_file(*block[i]);
      progress.advance(1);
    });
    run::throw_if_interrupted();
    for (std::size_t i = 0; i < block.size(); ++i) hashes_[block[i]->key()] = made[i];
    append(block);
  }
}

std::optional<PictureHash> PictureHashes::find(const std::string& key) const {
  const auto found = hashes_.find(key);
  return found == hashes_.end() ? std::nullopt : found->second;
}

// Appends lines to the file. If a kill cuts a line short, that line and the next one, which is appended to
// it, fail their check when read. Their two pictures are hashed again.
void PictureHashes::append(const std::vector<const PictureFile*>& pictures) const {
  std::string lines;
  for (const PictureFile* picture : pictures) {
    lines += manifests::seal_line(line_of(picture->key(), hashes_.at(picture->key())));
  }
  std::ofstream stream(file_, std::ios::app | std::ios::binary);
  stream << lines << std::flush;
  if (!stream) throw std::runtime_error(fmt::format("{}: cannot be written to", file_.string()));
}

}  // namespace q3d::pipeline::leakage
