// The tables of a training config, one for each struct (pipeline/config/setting.h).
#pragma once

#include "pipeline/config/setting.h"
#include "pipeline/config/settings_page.h"
#include "pipeline/training/settings/training_config.h"

namespace q3d::pipeline::training::settings {

const config::Settings<TrainingConfig>& training_settings();  // the top level's own keys, without the feed's
const config::Settings<TrainingNetworkConfig>& training_network_settings();
const config::Settings<PoolConfig>& pool_settings();
const config::Settings<PhaseConfig>& phase_settings();
const config::Settings<feed::FeedOptions>& feed_settings();  // keys of the top level too
const config::Settings<loaders::pictures::AugmentOptions>& augmentation_settings();
const config::Settings<DomainConfig>& domain_settings();
const config::Settings<model::settings::LossWeights>& loss_weight_settings();

// Returns the tables of docs/training.md: training, training network, pools, phases, augmentation, domain and
// loss weights.
config::SettingsTables training_settings_tables();

}  // namespace q3d::pipeline::training::settings
