// JSON documents that end with a digest over themselves, so that a reader finds every damaged byte.
//
// The last two lines of such a file are
//
//     "digest": "<64 hex digits>"
//   }
//
// where the digits are the SHA-256 of all bytes before these two lines. `head -n -2 FILE | sha256sum`
// computes the same.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>

namespace q3d::manifests {

inline constexpr const char* kDigestKey = "digest";

// Says that the bytes of a document are not those that were written: it is no readable JSON, or has another
// digest.
class DamagedDocument : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// Returns the text of a document: its members, indented by two spaces, then its digest. Throws
// std::invalid_argument unless `document` is an object that has members, none of them named "digest".
std::string seal_json(const nlohmann::ordered_json& document);

struct SealedDocument {
  nlohmann::ordered_json document;  // without the digest
  bool has_digest = false;          // true if the file has a digest, which is then correct
};

// Reads a document that may have a digest. Throws DamagedDocument that names the file, what was found and
// what was expected if the text is no JSON object, repeats a key, or differs from its digest. Throws IoError
// if the file cannot be read.
SealedDocument read_sealed_json(const std::filesystem::path& file);

}  // namespace q3d::manifests
