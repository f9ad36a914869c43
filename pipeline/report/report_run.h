// `report`: writes statistics.json and report.html of a finished dataset.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>

#include "pipeline/config/build_config.h"
#include "pipeline/device/body_meshes.h"

namespace q3d::pipeline::report {

struct ReportOptions {
  std::filesystem::path dataset;              // a version's folder, or an output folder
  std::optional<config::BuildConfig> config;  // the build's, where pictures or the body are not found
  std::filesystem::path body;                 // body model; empty: the one that the dataset was made with
  std::filesystem::path folder;               // empty: <output folder>/report/<version>
  std::size_t gallery_size = 6;               // pictures in each gallery; 0 draws none
};

struct ReportSummary {
  std::filesystem::path page;
  std::filesystem::path statistics;
  bool was_up_to_date = false;
};

// Writes statistics.json, report.html and, last, manifest.json with their digests and the key of their
// inputs. If these files exist and are undamaged, nothing is made again. The page shows tsne.json in the
// folder (tools/shape_tsne.py) if it belongs to this dataset. Without a body model the galleries have no
// meshes, and a note on the page says why. Throws std::runtime_error for a damaged dataset,
// manifests::IoError and Interrupted.
ReportSummary write_report(const ReportOptions& options, const device::BodyMeshesLoader& load_bodies);

}  // namespace q3d::pipeline::report
