#include "pipeline/unit/encode.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <iterator>
#include <stdexcept>

#include "loaders/pictures/encode.h"
#include "pipeline/unit/judge.h"

namespace q3d::pipeline::unit {
namespace {

std::vector<std::size_t> kept_without_crop(const UnitWork& work) {
  std::vector<std::size_t> samples;
  for (std::size_t i = 0; i < work.candidates.size(); ++i) {
    if (is_kept(work.judgements[i]) && find_crop(work, i) == nullptr) samples.push_back(i);
  }
  return samples;
}

EncodedCrop encoded(std::size_t sample, const loaders::pictures::StoredCrop& crop,
                    const config::ShardConfig& shards) {
  EncodedCrop result;
  result.sample = sample;
  result.side_px = crop.rgb.cols;
  result.from_image = crop.from_image;
  if (shards.images == manifests::ImageEncoding::reference) return result;
  result.picture = shards.images == manifests::ImageEncoding::png
                       ? loaders::pictures::encode_png(crop.rgb)
                       : loaders::pictures::encode_jpeg(crop.rgb, shards.jpeg_quality);
  if (!crop.mask.empty()) result.mask = loaders::pictures::encode_png(crop.mask);
  return result;
}

}  // namespace

void encode_crops(UnitWork& work, const config::ShardConfig& shards) {
  const std::vector<std::size_t> samples =
      work.shard_before ? std::vector<std::size_t>() : kept_without_crop(work);
  for (const std::size_t i : samples) {
    if (work.decoded[i].stored_crop) continue;
    throw std::runtime_error(fmt::format(
        "{}: the picture {} could be read before and cannot now ({}); put it back and build again",
        work.candidates[i].record.id, work.candidates[i].record.image_path, work.decoded[i].detail));
  }
  std::vector<EncodedCrop> added(samples.size());
  tbb::parallel_for(std::size_t{0}, samples.size(), [&](std::size_t j) {
    std::optional<loaders::pictures::StoredCrop>& crop = work.decoded[samples[j]].stored_crop;
    added[j] = encoded(samples[j], *crop, shards);
    crop.reset();
  });
  std::vector<EncodedCrop> merged;
  merged.reserve(work.crops.size() + added.size());
  std::merge(std::move_iterator(work.crops.begin()), std::move_iterator(work.crops.end()),
             std::move_iterator(added.begin()), std::move_iterator(added.end()), std::back_inserter(merged),
             [](const EncodedCrop& a, const EncodedCrop& b) { return a.sample < b.sample; });
  work.crops = std::move(merged);
  work.crops_encoded = samples.size();
  work.decoded.clear();
}

}  // namespace q3d::pipeline::unit
