#include "manifests/shard.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>

#include "manifests/json_parse.h"
#include "manifests/keypoint_names.h"
#include "manifests/shard_columns.h"

namespace q3d::manifests {
namespace {

constexpr std::string_view kFormat = "quadruped3d-shard";

// Returns a description of each column, for readers who do not have docs/shard-format.md.
std::string describe_columns() {
  nlohmann::json columns;
  for (const ShardColumn& column : shard_columns()) {
    columns[column.name] = {{"dtype", dtype_of(column)},
                            {"shape", shape_of(column)},
                            {"units", column.units},
                            {"meaning", column.meaning}};
  }
  return columns.dump();
}

std::string describe_datasets(const std::map<std::string, DatasetTerms>& datasets) {
  nlohmann::json object = nlohmann::json::object();
  for (const auto& [name, terms] : datasets) {
    object[name] = {
        {"licence", terms.licence}, {"source_url", terms.source_url}, {"citation", terms.citation}};
  }
  return object.dump();
}

std::map<std::string, DatasetTerms> datasets_from(const std::string& text) {
  std::map<std::string, DatasetTerms> datasets;
  const nlohmann::json object = parse_json<nlohmann::json>(text);
  for (const auto& [name, terms] : object.items()) {
    datasets[name] = {terms.at("licence").get<std::string>(), terms.at("source_url").get<std::string>(),
                      terms.at("citation").get<std::string>()};
  }
  return datasets;
}

std::string keypoint_names_text() {
  return nlohmann::json(kKeypointNames).dump();
}

void check_sample(const ShardHeader& header, const ShardSample& sample) {
  const bool must_have_crop = header.image_encoding != ImageEncoding::reference;
  if (sample.record.failure != Reason::none) {
    throw std::invalid_argument(fmt::format("sample {} failed ({}) and cannot be in a shard",
                                            sample.record.id, to_string(sample.record.failure)));
  }
  if (sample.crop.empty() == must_have_crop || (!must_have_crop && !sample.crop_mask.empty())) {
    throw std::invalid_argument(
        fmt::format("sample {} has a crop of {} bytes and a mask of {} in a shard of {}", sample.record.id,
                    sample.crop.size(), sample.crop_mask.size(), to_string(header.image_encoding)));
  }
}

void add_column(Table& table, const ShardColumn& column, const std::vector<ShardSample>& samples) {
  if (const auto* number = std::get_if<NumberColumn>(&column.content)) {
    const auto row_bytes =
        static_cast<std::size_t>(elements_per_row(number->row_shape)) * size_of(number->type);
    NumericColumn values{number->type, number->row_shape, std::vector<std::byte>(samples.size() * row_bytes)};
    for (std::size_t row = 0; row < samples.size(); ++row) {
      number->store(samples[row], &values.data[row * row_bytes]);
    }
    table.numeric.emplace(column.name, std::move(values));
  } else if (const auto* text = std::get_if<TextColumn>(&column.content)) {
    auto& values = table.text[column.name];
    for (const ShardSample& sample : samples) values.push_back(text->store(sample));
  } else {
    auto& values = table.blob_views[column.name];
    for (const ShardSample& sample : samples) {
      values.emplace_back(sample.*std::get<BytesColumn>(column.content).member);
    }
  }
}

// Returns the schema that the text states, if this program can read it.
std::optional<int> known_schema(const std::string& text) {
  for (int schema = 1; schema <= kShardSchema; ++schema) {
    if (text == std::to_string(schema)) return schema;
  }
  return std::nullopt;
}

// Checks magic and schema, in that order, before anything else of the file is read.
std::filesystem::path check_identity(const std::filesystem::path& path) {
  const auto attributes = read_table_attributes(path);
  const auto format = attributes.find("format");
  if (format == attributes.end() || format->second != kFormat) {
    throw std::runtime_error(
        fmt::format("{}: attribute format is {}, expected \"{}\": not a shard", path.string(),
                    format == attributes.end() ? "absent" : '"' + format->second + '"', kFormat));
  }
  const auto schema = attributes.find("schema");
  if (schema == attributes.end() || !known_schema(schema->second)) {
    throw std::runtime_error(
        fmt::format("{}: shard schema {}, but this program reads schemas 1 to {}. Use the version of the "
                    "program that wrote it, or build the dataset again.",
                    path.string(), schema == attributes.end() ? "absent" : schema->second, kShardSchema));
  }
  return path;
}

ShardHeader read_header(const TableReader& table) {
  const auto text = [&](const char* name) -> const std::string& {
    const auto found = table.attributes().find(name);
    if (found == table.attributes().end()) {
      throw std::runtime_error(fmt::format("{}: attribute {} is absent", table.path().string(), name));
    }
    return found->second;
  };
  ShardHeader header{
      .schema = known_schema(text("schema")).value(), .dataset = text("dataset"), .version = text("version")};
  const std::string& unit = text("unit");
  const auto [end, error] = std::from_chars(unit.data(), unit.data() + unit.size(), header.unit);
  if (error != std::errc() || end != unit.data() + unit.size()) {
    throw std::runtime_error(
        fmt::format("{}: attribute unit is \"{}\", expected a whole number", table.path().string(), unit));
  }
  const std::string& encoding = text("image_encoding");
  try {
    header.image_encoding = image_encoding_from_string(encoding);
  } catch (const std::invalid_argument&) {
    throw std::runtime_error(
        fmt::format("{}: attribute image_encoding is \"{}\", expected jpeg, png or reference",
                    table.path().string(), encoding));
  }
  if (header.schema < 2) return header;
  if (text("keypoint_names") != keypoint_names_text()) {
    throw std::runtime_error(fmt::format("{}: attribute keypoint_names is {}, expected {}",
                                         table.path().string(), text("keypoint_names"),
                                         keypoint_names_text()));
  }
  try {
    header.datasets = datasets_from(text("datasets"));
  } catch (const nlohmann::json::exception& fault) {
    throw std::runtime_error(
        fmt::format("{}: attribute datasets: {}; expected an object of objects with "
                    "licence, source_url and citation",
                    table.path().string(), fault.what()));
  }
  return header;
}

bool matches(const ShardColumn& expected, const TableReader::Column& got) {
  if (const auto* number = std::get_if<NumberColumn>(&expected.content)) {
    return got.kind == TableReader::Kind::numeric && got.type == number->type &&
           got.row_shape == number->row_shape;
  }
  const bool is_text = std::holds_alternative<TextColumn>(expected.content);
  return got.kind == (is_text ? TableReader::Kind::text : TableReader::Kind::blob);
}

void check_completeness(const TableReader& table, int schema) {
  const auto& columns = table.columns();
  for (const ShardColumn& expected : shard_columns()) {
    if (expected.since > schema) continue;
    const auto got = columns.find(expected.name);
    if (got == columns.end() || !matches(expected, got->second)) {
      throw std::runtime_error(fmt::format("{}: column {} is {}, expected {} {}", table.path().string(),
                                           expected.name,
                                           got == columns.end() ? "absent" : "of another type or shape",
                                           dtype_of(expected), shape_of(expected)));
    }
  }
  for (const auto& [name, column] : columns) {
    const auto known = [&name = name, schema](const ShardColumn& expected) {
      return expected.name == name && expected.since <= schema;
    };
    if (std::none_of(shard_columns().begin(), shard_columns().end(), known)) {
      throw std::runtime_error(
          fmt::format("{}: column {} is not in schema {}", table.path().string(), name, schema));
    }
  }
}

void load_column(const TableReader& table, const ShardColumn& column, std::int64_t first,
                 std::vector<ShardSample>& samples) {
  const auto count = static_cast<std::int64_t>(samples.size());
  std::size_t row = 0;
  try {
    if (const auto* number = std::get_if<NumberColumn>(&column.content)) {
      const NumericColumn values = table.numeric(column.name, first, count);
      const std::size_t row_bytes = values.data.size() / samples.size();
      for (; row < samples.size(); ++row) number->load(samples[row], &values.data[row * row_bytes]);
    } else if (const auto* text = std::get_if<TextColumn>(&column.content)) {
      std::vector<std::string> values = table.text(column.name, first, count);
      for (; row < samples.size(); ++row) text->load(samples[row], std::move(values[row]));
    } else {
      auto values = table.blobs(column.name, first, count);
      const auto member = std::get<BytesColumn>(column.content).member;
      for (; row < samples.size(); ++row) samples[row].*member = std::move(values[row]);
    }
  } catch (const std::exception& error) {
    throw std::runtime_error(fmt::format("{}: column {}, row {}: {}", table.path().string(), column.name,
                                         first + static_cast<std::int64_t>(row), error.what()));
  }
}

}  // namespace

std::string write_shard(const std::filesystem::path& path, const ShardHeader& header,
                        const std::vector<ShardSample>& samples) {
  if (header.schema != kShardSchema) {
    throw std::invalid_argument(
        fmt::format("a shard header of schema {}, expected {}", header.schema, kShardSchema));
  }
  Table table;
  table.rows = static_cast<std::int64_t>(samples.size());
  table.attributes = {{"format", std::string(kFormat)},
                      {"schema", std::to_string(header.schema)},
                      {"dataset", header.dataset},
                      {"version", header.version},
                      {"unit", std::to_string(header.unit)},
                      {"image_encoding", std::string(to_string(header.image_encoding))},
                      {"keypoint_names", keypoint_names_text()},
                      {"datasets", describe_datasets(header.datasets)},
                      {"columns", describe_columns()}};
  for (const ShardSample& sample : samples) check_sample(header, sample);
  for (const ShardColumn& column : shard_columns()) add_column(table, column, samples);
  return write_table(path, table);
}

ShardReader::ShardReader(const std::filesystem::path& path) : table_(check_identity(path)) {
  header_ = read_header(table_);
  check_completeness(table_, header_.schema);
}

std::vector<ShardSample> ShardReader::samples(std::int64_t first, std::int64_t count) const {
  if (first < 0 || count < 0 || first > rows() || count > rows() - first) {
    throw std::out_of_range(fmt::format("{}: {} rows from {} on, but there are {}", table_.path().string(),
                                        count, first, rows()));
  }
  std::vector<ShardSample> samples(static_cast<std::size_t>(count));
  if (samples.empty()) return samples;
  for (const ShardColumn& column : shard_columns()) {
    if (column.since <= header_.schema) load_column(table_, column, first, samples);
  }
  return samples;
}

Shard read_shard(const std::filesystem::path& path) {
  const ShardReader reader(path);
  return {reader.header(), reader.samples(0, reader.rows())};
}

}  // namespace q3d::manifests
