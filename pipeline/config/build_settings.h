// The tables of a build's config, one for each struct (setting.h).
#pragma once

#include "pipeline/config/build_config.h"
#include "pipeline/config/setting.h"

namespace q3d::pipeline::config {

const Settings<BuildConfig>& build_settings();      // the top level's own keys
const Settings<DatasetConfig>& dataset_settings();  // without own_label_settings
// The keys that belong to the formats whose keypoints a topology describes.
const Settings<DatasetConfig>& own_label_settings();
const Settings<NetworkConfig>& network_settings();
const Settings<TtaConfig>& tta_settings();
const Settings<FilterConfig>& filter_settings();
const Settings<DatasetThresholds>& dataset_threshold_settings();
const Settings<GuardConfig>& guard_settings();
const Settings<ShardConfig>& shard_settings();
const Settings<LeakageConfig>& leakage_settings();
const Settings<CalibrateConfig>& calibrate_settings();

}  // namespace q3d::pipeline::config
