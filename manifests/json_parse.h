// Parses JSON that may be damaged or hostile. nlohmann's parser does not recurse, but copying, comparing and
// printing a document does, so a text must not be able to choose how deep that goes.
#pragma once

#include <nlohmann/json.hpp>
#include <string_view>

#include "manifests/json_builder.h"

namespace q3d::manifests {

// Throws Json::exception, TooDeep and RepeatedKey.
template <typename Json>
Json parse_json(std::string_view text) {
  JsonBuilder<Json> builder;
  Json::sax_parse(text, &builder);
  return builder.document();
}

// The same, for files that only save work: null if the text is no such JSON.
template <typename Json>
Json parse_json_or_null(std::string_view text) {
  try {
    return parse_json<Json>(text);
  } catch (const typename Json::exception&) {
    return nullptr;
  } catch (const TooDeep&) {
    return nullptr;
  } catch (const RepeatedKey&) {
    return nullptr;
  }
}

}  // namespace q3d::manifests
