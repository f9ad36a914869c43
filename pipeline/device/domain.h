// The domain of a checkpoint describes the pictures that its network knows. It is stored in the file's
// metadata under kDomainKey. `train` writes it (pipeline/training/held_out.h), tools/import_assets.py writes
// what the paper states, and tools/describe_checkpoint.py adds it to a checkpoint that has none.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace q3d::pipeline::device {

inline constexpr const char* kDomainKey = "prima_domain";  // in the metadata of a checkpoint
// The name that the body model of the rendered world has in its asset file.
inline constexpr const char* kSyntheticBodyName = "synthetic quadruped";

enum class Pictures : std::uint8_t { unknown, photographs, rendered };
// Throws std::invalid_argument for another name.
Pictures pictures_from_string(std::string_view name);

struct ErrorQuantile {
  double share = 0.0;   // fraction of the held-out pictures, between 0 and 1
  double l_proj = 0.0;  // crop units; this fraction of the pictures has at most this L_proj
};

struct NetworkDomain {
  Pictures pictures = Pictures::unknown;
  std::string trained_on;  // for people
  // Quantiles of the predictions' L_proj on pictures of the same kind that training has not seen, ascending
  // in share. Empty if nobody has measured them.
  std::string held_out;  // describes these pictures for people
  std::int64_t held_out_pictures = 0;
  std::vector<ErrorQuantile> quantiles;
};

// Returns the domain as JSON text:
//   {"pictures": "rendered", "trained_on": "...",
//    "held_out": {"pictures": 500, "what": "...", "l_proj": {"0.05": 0.02, "0.5": 0.04, "0.95": 0.12}}}
std::string to_json(const NetworkDomain& domain);
// Reads such a text. Throws std::runtime_error that says what was found and what was expected for a text of
// another form.
NetworkDomain domain_from_json(const std::string& text);

// Returns the quantile of exactly this share, if it was measured.
std::optional<double> quantile(const NetworkDomain& domain, double share);

// Measures quantiles of some errors, linearly interpolated, as numpy does. Throws std::invalid_argument
// without errors and for errors that are not finite.
std::vector<ErrorQuantile> quantiles_of(std::vector<double> errors, const std::vector<double>& shares);

}  // namespace q3d::pipeline::device
