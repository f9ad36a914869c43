#include "manifests/sealed_json.h"

#include <gmock/gmock.h>

#include "manifests/atomic_file.h"
#include "manifests/digest.h"
#include "tests/support/paths.h"

namespace q3d::manifests {
namespace {

using nlohmann::ordered_json;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

class SealedJson : public ::testing::Test {
 protected:
  SealedDocument read(std::string_view text) const {
    write_file_atomically(file_, text);
    return read_sealed_json(file_);
  }

  testing::ScratchDir scratch_;
  std::filesystem::path file_ = scratch_.path() / "about.json";
};

// The digest is the one that `head -n -2 about.json | sha256sum` prints.
TEST_F(SealedJson, EndsWithTheDigestOfTheLinesBefore) {
  const std::string text = seal_json({{"name", "zoo"}, {"shards", {1, 2}}});
  const std::string before = "{\n  \"name\": \"zoo\",\n  \"shards\": [\n    1,\n    2\n  ],\n";
  EXPECT_EQ(text, before + "  \"digest\": \"" + sha256(before) + "\"\n}\n");
}

TEST_F(SealedJson, GivesTheDocumentBackWithoutItsDigest) {
  const ordered_json document = {{"b", "\"digest\": \"x\""}, {"a", {{"digest", nullptr}}}, {"c", 0.1}};
  const SealedDocument read_back = read(seal_json(document));
  EXPECT_TRUE(read_back.has_digest);
  EXPECT_EQ(read_back.document.dump(), document.dump());
}

TEST_F(SealedJson, ADocumentWithoutDigestIsReadAndSaysSo) {
  const SealedDocument plain = read("{\"a\": 1}");
  EXPECT_FALSE(plain.has_digest);
  EXPECT_EQ(plain.document, (ordered_json{{"a", 1}}));
}

// Beside damage, one flip is left: it makes another name of the member "digest", so that the document says
// that it has none. Its reader knows whether it must have one.
TEST_F(SealedJson, EveryFlippedBitIsFound) {
  const std::string sound = seal_json({{"name", "zoo"}, {"count", 12}, {"list", {true, nullptr}}});
  const std::size_t name = sound.rfind("\"digest\"") + 1;
  for (std::size_t at = 0; at < sound.size(); ++at) {
    for (int bit = 0; bit < 8; ++bit) {
      std::string text = sound;
      text[at] = static_cast<char>(text[at] ^ (1 << bit));
      try {
        const SealedDocument read_back = read(text);
        EXPECT_FALSE(read_back.has_digest) << "byte " << at << " bit " << bit;
        EXPECT_TRUE(at >= name && at < name + std::string_view("digest").size()) << "byte " << at;
      } catch (const DamagedDocument& error) {
        EXPECT_THAT(error.what(), HasSubstr(file_.string()));
      }
    }
  }
}

TEST_F(SealedJson, EveryCutIsFound) {
  const std::string sound = seal_json({{"name", "zoo"}});
  for (std::size_t size = 0; size < sound.size(); ++size) {
    EXPECT_THROW(read(sound.substr(0, size)), DamagedDocument) << size;
  }
}

TEST_F(SealedJson, ADigestElsewhereIsDamage) {
  EXPECT_THAT([&] { read("{\"digest\": \"ab\", \"a\": 1}"); },
              ThrowsMessage<DamagedDocument>(HasSubstr("not its last line but one")));
}

TEST_F(SealedJson, RefusesAKeyThatStandsTwice) {
  EXPECT_THAT([&] { read("{\"a\": 1, \"b\": [{\"c\": 1}, {\"c\": 2, \"c\": 3}]}"); },
              ThrowsMessage<DamagedDocument>(HasSubstr("the key \"c\" stands twice in one object")));
  EXPECT_NO_THROW(read("{\"a\": {\"a\": [{\"a\": 1}, {\"a\": 2}]}}"));
}

TEST_F(SealedJson, RefusesWhatIsNoObjectWithMembers) {
  EXPECT_THROW(seal_json(ordered_json::array()), std::invalid_argument);
  EXPECT_THROW(seal_json(ordered_json::object()), std::invalid_argument);
  EXPECT_THROW(seal_json({{"digest", 1}}), std::invalid_argument);
  EXPECT_THAT([&] { read("[1]"); }, ThrowsMessage<DamagedDocument>(HasSubstr("expected one")));
}

}  // namespace
}  // namespace q3d::manifests
