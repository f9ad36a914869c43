#include "smal/tensors/safetensors.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstring>
#include <fstream>
#include <random>
#include <string_view>

#include "tests/support/paths.h"

namespace q3d::smal::tensors {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class SafeTensorsFile : public ::testing::Test {
 protected:
  // Writes length, header and data as given: the format itself, without our writer.
  std::filesystem::path write(const std::string& header, const std::string& data) {
    std::uint64_t length = header.size();
    std::string bytes(8, '\0');
    std::memcpy(bytes.data(), &length, 8);
    return write_bytes(bytes + header + data);
  }
  std::filesystem::path write_bytes(const std::string& bytes) {
    const auto path = scratch_.path() / "file.safetensors";
    std::ofstream(path, std::ios::binary) << bytes;
    return path;
  }
  void expect_refused(const std::filesystem::path& path, const std::string& reason) {
    try {
      SafeTensors::open(path);
      ADD_FAILURE() << "accepted, expected: " << reason;
    } catch (const std::runtime_error& error) {
      EXPECT_THAT(error.what(), HasSubstr(path.string()));
      EXPECT_THAT(error.what(), HasSubstr(reason));
      EXPECT_LT(std::strlen(error.what()), 1000u);
    }
  }

  testing::ScratchDir scratch_;
};

template <typename T>
std::string raw(std::initializer_list<T> values) {
  std::string bytes;
  for (const T value : values) bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
  return bytes;
}

TEST_F(SafeTensorsFile, ReadsEveryDtype) {
  // One element each, in an order that leaves some misaligned: 2.5, as a half 0x4100, as a bfloat16 0x4020.
  const std::string header =
      R"({"__metadata__":{"format":"pt"},"bool":{"dtype":"BOOL","shape":[1],"data_offsets":[0,1]},)"
      R"("f64":{"dtype":"F64","shape":[1],"data_offsets":[1,9]},"f32":{"dtype":"F32","shape":[],"data_offsets":[9,13]},)"
      R"("f16":{"dtype":"F16","shape":[1],"data_offsets":[13,15]},"bf16":{"dtype":"BF16","shape":[1],"data_offsets":[15,17]},)"
      R"("i64":{"dtype":"I64","shape":[1],"data_offsets":[17,25]},"i32":{"dtype":"I32","shape":[1],"data_offsets":[25,29]},)"
      R"("i16":{"dtype":"I16","shape":[1],"data_offsets":[29,31]},"i8":{"dtype":"I8","shape":[1],"data_offsets":[31,32]},)"
      R"("u8":{"dtype":"U8","shape":[1],"data_offsets":[32,33]},"none":{"dtype":"F32","shape":[0,7],"data_offsets":[33,33]}})";
  const std::string data = raw<std::uint8_t>({1}) + raw({2.5}) + raw({2.5f}) +
                           raw<std::uint16_t>({0x4100, 0x4020}) + raw<std::int64_t>({-(1LL << 40)}) +
                           raw<std::int32_t>({-70000}) + raw<std::int16_t>({-300}) + raw<std::int8_t>({-5}) +
                           raw<std::uint8_t>({250});
  const auto file = SafeTensors::open(write(header, data));
  EXPECT_EQ(file.metadata().at("format"), "pt");
  EXPECT_THAT(file.names(),
              ElementsAre("bf16", "bool", "f16", "f32", "f64", "i16", "i32", "i64", "i8", "none", "u8"));
  EXPECT_TRUE(file.contains("i8"));
  EXPECT_FALSE(file.contains("__metadata__"));
  EXPECT_EQ(file.tensor("f32").dim(), 0);
  EXPECT_THAT(file.tensor("none").sizes().vec(), ElementsAre(0, 7));
  const std::vector<std::tuple<const char*, torch::ScalarType, double>> expected = {
      {"bool", torch::kBool, 1},        {"f64", torch::kFloat64, 2.5},
      {"f32", torch::kFloat32, 2.5},    {"f16", torch::kFloat16, 2.5},
      {"bf16", torch::kBFloat16, 2.5},  {"i64", torch::kInt64, -1099511627776.0},
      {"i32", torch::kInt32, -70000.0}, {"i16", torch::kInt16, -300.0},
      {"i8", torch::kInt8, -5},         {"u8", torch::kUInt8, 250}};
  for (const auto& [name, dtype, value] : expected) {
    const torch::Tensor tensor = file.tensor(name);
    EXPECT_EQ(tensor.scalar_type(), dtype) << name;
    EXPECT_EQ(tensor.to(torch::kFloat64).item<double>(), value) << name;
  }
}

TEST_F(SafeTensorsFile, TensorsOutliveTheFileObject) {
  torch::Tensor tensor;
  {
    const auto file = SafeTensors::open(
        write(R"({"a":{"dtype":"F32","shape":[2],"data_offsets":[0,8]}}      )", raw({1.5f, -2.0f})));
    tensor = file.tensor("a");
  }
  EXPECT_EQ(tensor[0].item<float>(), 1.5f);
  EXPECT_EQ(tensor[1].item<float>(), -2.0f);
}

TEST_F(SafeTensorsFile, RefusesFilesThatAreNotSafeTensors) {
  expect_refused(scratch_.path() / "absent", "cannot open");
  expect_refused(scratch_.path(), "not a regular file");
  expect_refused(write_bytes(""), "0 bytes");
  expect_refused(write_bytes("seven.."), "7 bytes");
  expect_refused(write_bytes(raw<std::uint64_t>({1000}) + "{}"),
                 "a header of 1000 bytes in a file of 10 bytes");
  expect_refused(write_bytes(raw<std::uint64_t>({~0ULL}) + "{}"), "expected at most 100000000");
  expect_refused(write_bytes(raw<std::uint64_t>({100'000'001}) + "{}"), "expected at most 100000000");
  expect_refused(write("", ""), "not JSON");
  expect_refused(write("{\"a\":", ""), "not JSON");
  expect_refused(write("{\"\xff\":{}}", ""), "not JSON");
  expect_refused(write("[]", ""), "not an object of flat objects");
  expect_refused(write("3", ""), "not an object of flat objects");
}

TEST_F(SafeTensorsFile, DoesNotWaitForAPipe) {
  const auto pipe = scratch_.path() / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  expect_refused(pipe, "not a regular file");
}

TEST_F(SafeTensorsFile, RefusesDeepOrLongHeaders) {
  const std::string brackets(2'000'000, '[');
  expect_refused(write(brackets, ""), "not an object of flat objects");
  expect_refused(write("{\"a\":" + brackets, ""), "not an object of flat objects");
  expect_refused(write(R"({"a":{"dtype":"U8","shape":)" + brackets, ""), "not an object of flat objects");
  expect_refused(write(R"({"a":{"dtype":{"dtype":"U8"}}})", ""), "not an object of flat objects");
  std::string ones = "1";
  for (int i = 0; i < 1'000'000; ++i) ones += ",1";
  expect_refused(write(R"({"a":{"dtype":"U8","data_offsets":[0,1],"shape":[)" + ones + "]}}", "x"),
                 "more than 64 sizes");
  expect_refused(write("{\"" + std::string(3'000'000, 'n') + "\":{}}", ""), "has no 'dtype'");
}

TEST_F(SafeTensorsFile, RefusesBadEntries) {
  const auto entry = [](const std::string& dtype, const std::string& shape, const std::string& offsets) {
    return "{\"a\":{\"dtype\":" + dtype + ",\"shape\":" + shape + ",\"data_offsets\":" + offsets + "}}";
  };
  expect_refused(write(entry("\"F8\"", "[1]", "[0,1]"), "x"), "unknown dtype");
  expect_refused(write(entry("7", "[1]", "[0,1]"), "x"), "unknown dtype");
  expect_refused(write(R"({"a":{"shape":[1],"data_offsets":[0,1]}})", "x"), "has no 'dtype'");
  expect_refused(write(R"({"a":{"dtype":"U8","data_offsets":[0,1]}})", "x"), "has no 'shape'");
  expect_refused(write(R"({"a":{"dtype":"U8","shape":[1]}})", "x"), "has no 'data_offsets'");
  expect_refused(write(entry("\"U8\"", "1", "[0,1]"), "x"), "'shape' is not a list");
  expect_refused(write(entry("\"U8\"", "[-1]", "[0,1]"), "x"), "'shape' holds '-1'");
  expect_refused(write(entry("\"U8\"", "[1.0]", "[0,1]"), "x"), "'shape' holds '1.0'");
  expect_refused(write(entry("\"U8\"", "[18446744073709551615]", "[0,1]"), "x"), "'shape' holds");
  expect_refused(write(entry("\"U8\"", "[1]", "[0,1,2]"), "x"), "has 3 data_offsets");
  expect_refused(write(entry("\"F32\"", "[4294967296,4294967296]", "[0,1]"), "x"), "overflows");
  expect_refused(write(entry("\"F32\"", "[0,4294967296,4294967296]", "[0,0]"), ""), "overflows");
  expect_refused(write(entry("\"F32\"", "[1]", "[0,3]"), "xxx"), "has 3 bytes, expected 4");
  expect_refused(write(entry("\"U8\"", "[1]", "[0,2]"), "x"), "outside the 1 bytes");
  expect_refused(write(entry("\"U8\"", "[1]", "[1,0]"), "x"), "outside the 1 bytes");
  expect_refused(write(R"({"__metadata__":{"n":1}})", ""), "'n' is not a string");
}

TEST_F(SafeTensorsFile, RefusesHolesOverlapsAndDuplicates) {
  const auto two = [](const char* first, const char* second, const char* name = "b") {
    return std::string(R"({"a":{"dtype":"U8","shape":[2],"data_offsets":)") + first + "},\"" + name +
           R"(":{"dtype":"U8","shape":[2],"data_offsets":)" + second + "}}";
  };
  EXPECT_NO_THROW(SafeTensors::open(write(two("[2,4]", "[0,2]"), "xxxx")));
  expect_refused(write(two("[0,2]", "[1,3]"), "xxx"), "inside another entry");
  expect_refused(write(two("[0,2]", "[3,5]"), "xxxxx"), "after a hole");
  expect_refused(write(two("[1,3]", "[3,5]"), "xxxxx"), "after a hole");
  expect_refused(write(two("[0,2]", "[2,4]"), "xxxxx"), "the data has 5 bytes, expected 4");
  expect_refused(write(two("[0,2]", "[2,4]"), "xxx"), "outside the 3 bytes");
  expect_refused(write(two("[0,2]", "[2,4]", "a"), "xxxx"), "appears twice");
  expect_refused(write(R"({"a":{"dtype":"U8","dtype":"U8","shape":[1],"data_offsets":[0,1]}})", "x"),
                 "a key twice");
  expect_refused(write(R"({"__metadata__":{},"__metadata__":{}})", ""), "appears twice");
}

TEST_F(SafeTensorsFile, RefusesABoolThatIsNeitherZeroNorOne) {
  const auto file =
      SafeTensors::open(write(R"({"a":{"dtype":"BOOL","shape":[2],"data_offsets":[0,2]}})", "\x01\x02"));
  EXPECT_THROW(file.tensor("a"), std::runtime_error);
}

// Whatever the bytes, the file is either refused or every tensor of it can be read to the last element.
TEST_F(SafeTensorsFile, RandomDamageIsRefusedOrReadable) {
  const std::string header =
      R"({"__metadata__":{"k":"v"},"a":{"dtype":"F32","shape":[2,3],"data_offsets":[0,24]},)"
      R"("b":{"dtype":"I8","shape":[4],"data_offsets":[24,28]}})";
  const std::string good = raw<std::uint64_t>({header.size()}) + header + std::string(28, '\1');
  std::mt19937_64 random(41);
  int refused = 0;
  constexpr int kFiles = 400;
  for (int i = 0; i < kFiles; ++i) {
    std::string bytes = good;
    for (std::uint64_t changes = 1 + random() % 3; changes > 0; --changes) {
      constexpr std::string_view kAlphabet = "{}[]\",:0123456789FIU8\xff";
      bytes[random() % (8 + header.size())] = kAlphabet[random() % kAlphabet.size()];
    }
    if (random() % 4 == 0) bytes.resize(random() % bytes.size());
    const auto path = write_bytes(bytes);
    try {
      const auto file = SafeTensors::open(path);
      for (const std::string& name : file.names()) file.tensor(name).to(torch::kFloat64).sum().item<double>();
    } catch (const std::runtime_error&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, kFiles / 2);
  EXPECT_LT(refused, kFiles);
}

TEST_F(SafeTensorsFile, NamesAnAbsentTensor) {
  const auto file = SafeTensors::open(write("{}", ""));
  EXPECT_THAT([&] { file.tensor("weight"); },
              ::testing::ThrowsMessage<std::runtime_error>(HasSubstr("no tensor named 'weight'")));
}

TEST_F(SafeTensorsFile, WritesTheFormatByteForByte) {
  const auto path = scratch_.path() / "written.safetensors";
  write_safetensors(
      path, {{"b", torch::tensor({1.0f, 2.0f}).view({1, 2})}, {"a", torch::tensor({7}, torch::kUInt8)}},
      {{"k", "v"}});
  std::ifstream stream(path, std::ios::binary);
  const std::string got((std::istreambuf_iterator<char>(stream)), std::istreambuf_iterator<char>());
  std::string header = R"({"__metadata__":{"k":"v"},"b":{"dtype":"F32","shape":[1,2],"data_offsets":[0,8]},)"
                       R"("a":{"dtype":"U8","shape":[1],"data_offsets":[8,9]}})";
  header.resize((header.size() + 7) / 8 * 8, ' ');
  EXPECT_EQ(got, raw<std::uint64_t>({header.size()}) + header + raw({1.0f, 2.0f}) + raw<std::uint8_t>({7}));
}

TEST_F(SafeTensorsFile, WritesStridedTensorsAndReplacesWhole) {
  const auto path = scratch_.path() / "written.safetensors";
  const torch::Tensor grid = torch::arange(6, torch::kInt64).view({2, 3});
  write_safetensors(path, {{"old", grid}});
  write_safetensors(path, {{"transposed", grid.t()}});
  const auto file = SafeTensors::open(path);
  EXPECT_THAT(file.names(), ElementsAre("transposed"));
  EXPECT_TRUE(torch::equal(file.tensor("transposed"), grid.t()));
  const auto left = std::distance(std::filesystem::directory_iterator(scratch_.path()), {});
  EXPECT_EQ(left, 1) << "a temporary file was left behind";
}

TEST_F(SafeTensorsFile, WritingRefusesBadNamesAndPlaces) {
  const torch::Tensor one = torch::ones({1});
  const auto path = scratch_.path() / "written.safetensors";
  EXPECT_THROW(write_safetensors(path, {{"a", one}, {"a", one}}), std::runtime_error);
  EXPECT_THROW(write_safetensors(path, {{"__metadata__", one}}), std::runtime_error);
  EXPECT_THROW(write_safetensors(path, {{"a", torch::Tensor()}}), std::runtime_error);
  EXPECT_THROW(write_safetensors(path, {{"a", one.to(torch::kComplexFloat)}}), std::runtime_error);
  EXPECT_THAT(
      [&] {
        write_safetensors(scratch_.path() / "absent" / "x", {{"a", one}});
      },
      ::testing::ThrowsMessage<std::runtime_error>(HasSubstr("No such file")));
  EXPECT_TRUE(std::filesystem::is_empty(scratch_.path()));
}

}  // namespace
}  // namespace q3d::smal::tensors
