// Parses JSON that may be damaged or hostile. nlohmann's parser does not recurse, but copying, comparing and
// printing a document do. So a text must not be able to choose the depth of its document.
#pragma once

#include <nlohmann/json.hpp>
#include <string_view>

#include "manifests/json_builder.h"

namespace q3d::manifests {

// Returns the document. Throws Json::exception, TooDeep and RepeatedKey.
template <typename Json>
Json parse_json(std::string_view text) {
  JsonBuilder<Json> builder;
  Json::sax_parse(text, &builder);
  return builder.document();
}

// Parses a file that only saves work, such as a cache. Returns null where parse_json would throw.
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
