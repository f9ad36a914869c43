// The files of a training and the metadata of a checkpoint. The first byte of an input says which: s a
// state's position, l the log, c the sizes of a network, d the pictures that it knows.
#include <nlohmann/json.hpp>

#include "manifests/atomic_file.h"
#include "manifests/json_parse.h"
#include "model/config.h"
#include "pipeline/device/domain.h"
#include "pipeline/training/training_log.h"
#include "pipeline/training/training_state.h"
#include "smal/tensors/safetensors.h"
#include "tests/fuzz/fuzz_input.h"

namespace {

using q3d::fuzz::require;
namespace training = q3d::pipeline::training;
namespace device = q3d::pipeline::device;

// A state of a version that wrote no digest, so that any text comes through.
void read_state(const q3d::fuzz::Scratch& scratch, std::string_view bytes) {
  const auto file = scratch.root() / "state.safetensors";
  try {
    static_cast<void>(nlohmann::json(std::string(bytes)).dump());
  } catch (const nlohmann::json::type_error&) {
    return;  // no UTF-8, which the file's header cannot hold
  }
  q3d::smal::tensors::write_safetensors(file, {{"weight", torch::zeros({2})}},
                                        {{"training_position", std::string(bytes)}, {"training_key", "key"}});
  q3d::fuzz::value_or_refusal(file, [&] {
    const auto state = training::load_state(file, "key");
    require(state && state->position.phase >= 0 && state->position.step >= 0, "a position counts from 0");
  });
}

void read_log(const q3d::fuzz::Scratch& scratch, std::string_view bytes) {
  const auto file = scratch.write("log.jsonl", bytes);
  training::TrainingLog(file, 1, 5);
  const std::string kept = q3d::manifests::read_file(file);
  require(kept.size() <= bytes.size() + 1, "nothing is added to a log");
  training::TrainingLog(file, 1, 5);
  require(q3d::manifests::read_file(file) == kept, "lines that were kept are kept again", kept);
}

void read_network(std::string_view bytes) {
  const auto json = q3d::manifests::parse_json_or_null<nlohmann::json>(bytes);
  try {
    const q3d::model::PrimaConfig config = q3d::model::config_from_json(json);
    require(q3d::model::config_from_json(to_json(config)) == config, "sizes survive being written");
    require(config.heads > 0 && config.embed_dim % config.heads == 0, "heads divide the width");
  } catch (const std::invalid_argument&) {
  }
}

void read_domain(const std::string& text) {
  try {
    const device::NetworkDomain domain = device::domain_from_json(text);
    require(domain.held_out_pictures >= 0, "pictures are counted");
    const std::string written = to_json(domain);
    require(to_json(device::domain_from_json(written)) == written, "a domain survives being written",
            written);
  } catch (const std::runtime_error& error) {
    require(std::string_view(error.what()).find(device::kDomainKey) != std::string_view::npos,
            "a refusal names the entry", error.what());
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const q3d::fuzz::Scratch scratch;
  const auto [reader, bytes] = q3d::fuzz::chosen_reader(data, size);
  if (reader == 's') read_state(scratch, bytes);
  if (reader == 'l') read_log(scratch, bytes);
  if (reader == 'c') read_network(bytes);
  if (reader == 'd') read_domain(std::string(bytes));
  return 0;
}
