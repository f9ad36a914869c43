#include "pipeline/candidates/curation_list.h"

#include <fmt/format.h>

#include <stdexcept>

#include "manifests/atomic_file.h"
#include "manifests/csv.h"
#include "manifests/file_descriptor.h"
#include "pipeline/run/errors.h"

namespace q3d::pipeline::candidates {
namespace {

using manifests::csv_cell;

const std::vector<std::string> kHeader{"split", "picture", "verdict", "species", "source", "clip"};

std::map<std::string, std::string> read_chosen(const std::filesystem::path& list, const std::string& split) {
  const std::string text = manifests::read_file(list);
  manifests::CsvReader reader(text, list.string());
  std::vector<std::string> cells;
  if (!reader.next(cells) || cells != kHeader) {
    reader.fail("another header", "split,picture,verdict,species,source,clip as `curate` writes them");
  }
  std::map<std::string, std::string> chosen;
  while (reader.next(cells)) {
    if (cells.size() != kHeader.size()) {
      reader.fail(fmt::format("{} cells", cells.size()), fmt::format("{}", kHeader.size()));
    }
    if (cells[0] != split || cells[2] != loaders::curation::to_string(loaders::curation::Choice::chosen))
      continue;
    if (!chosen.emplace(cells[1], cells[3]).second) reader.fail("a picture listed before", "each once");
  }
  return chosen;
}

}  // namespace

std::string curation_csv(std::span<const loaders::curation::CuratedPicture> pictures,
                         std::span<const loaders::curation::Curated> choices) {
  std::string text;
  for (const std::string& name : kHeader) text += (text.empty() ? "" : ",") + name;
  text += '\n';
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    const loaders::curation::CuratedPicture& picture = pictures[i];
    text += fmt::format("{},{},{},{},{},{}\n", csv_cell(picture.split), csv_cell(picture.image_ref),
                        loaders::curation::to_string(choices[i].choice), csv_cell(choices[i].species),
                        csv_cell(picture.source), csv_cell(picture.clip));
  }
  return text;
}

std::map<std::string, std::string> chosen_pictures(const std::filesystem::path& list,
                                                   const std::string& split) {
  try {
    return read_chosen(list, split);
  } catch (const manifests::IoError& error) {
    if (!error.names_no_file()) throw;
    throw run::ConfigError(fmt::format("curation: {}", error.what()));
  } catch (const std::runtime_error& error) {
    throw run::ConfigError(fmt::format("curation: {}", error.what()));
  }
}

}  // namespace q3d::pipeline::candidates
