// The picture of a sample as an export writes it, with the sample's box and keypoints in its pixels.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "loaders/pictures/affine.h"
#include "manifests/image_encoding.h"
#include "manifests/shard.h"

namespace q3d::pipeline::exports {

// The kind of picture that an export needs of a sample.
enum class Pictures {
  as_stored,  // the bytes of the shard's crop, unchanged
  official,   // a crop in which the official code finds the network's crop again: it floors the box's centre
  none,       // no picture: numbers refer to the source's own picture
};

// Everything is in px of this picture; `from_image` maps the source picture to it.
struct ExportedPicture {
  std::vector<std::byte> bytes;  // encoded; empty for Pictures::none
  std::vector<std::byte> mask;   // 8-bit PNG of the same size; empty when the sample has none
  int width_px = 0;
  int height_px = 0;
  loaders::pictures::Affine from_image{};
};

// Returns the picture of a sample from a shard of this image encoding.
//
// A crop that was reduced when it was stored has the centre of the network's crop between two pixels. For the
// official code, which floors that centre, such a crop is shifted by less than a pixel with OpenCV's Lanczos
// filter and encoded anew: JPEG of quality 95, or PNG. Other crops keep their bytes.
//
// Throws std::runtime_error if the stored crop does not decode.
ExportedPicture export_picture(const manifests::ShardSample& sample, manifests::ImageEncoding image_encoding,
                               Pictures pictures);

// Returns the sample's box in the exported picture. Its square_box() is the network's crop in that picture.
manifests::Box exported_box(const manifests::ShardSample& sample, const ExportedPicture& picture);

// Returns the file name of the sample's picture without its suffix, made of species, unit and row:
// "red+fox_000002_000117". The species can be read from it (loaders/species); "animal" stands for an unknown
// one.
std::string picture_stem(const manifests::ShardSample& sample, std::int64_t unit, std::int64_t row);

}  // namespace q3d::pipeline::exports
