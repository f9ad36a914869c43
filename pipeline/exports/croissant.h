// Writes the Croissant 1.1 metadata of an export that consists of JSON files and pictures.
#pragma once

#include <string>
#include <vector>

namespace q3d::pipeline::exports {

struct CroissantField {
  std::string name;
  std::string json_path;  // below one record
  std::string type;       // "sc:Text", "cr:Float64", "cr:Int64", ...
  std::string meaning;
  std::string shape{};  // "26,3"; empty for a single value
};

// The records of one JSON file.
struct CroissantRecords {
  std::string name;
  std::string file;
  std::string sha256;
  std::size_t bytes = 0;
  std::string records_path;  // JSON path of the list's elements: "$.data[*]"
  std::vector<CroissantField> fields;
};

struct CroissantDataset {
  std::string name;
  std::string description;
  std::string version;
  std::vector<std::string> licences;
  std::vector<std::string> citations;
  std::vector<std::string> sources;
  std::vector<CroissantRecords> records;
  std::vector<std::string> picture_patterns;  // "images/*.jpg"; none without pictures
};

// Returns the text of croissant.json.
std::string croissant_text(const CroissantDataset& dataset);

}  // namespace q3d::pipeline::exports
