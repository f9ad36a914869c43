// The choice of the number type, compared with what the kernel says about this machine's processor.
#include "model/mixed_precision.h"

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <set>
#include <sstream>
#include <string>

namespace q3d::model {
namespace {

// Returns the words behind the first line of /proc/cpuinfo that begins with `name`.
std::set<std::string> cpuinfo(const std::string& name) {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    if (!line.starts_with(name)) continue;
    std::istringstream words(line.substr(line.find(':') + 1));
    return {std::istream_iterator<std::string>(words), {}};
  }
  return {};
}

TEST(MixedPrecisionChoice, FollowsTheProcessor) {
  const std::set<std::string> flags = cpuinfo("flags");
  if (flags.empty()) GTEST_SKIP() << "the kernel lists no flags of an x86 processor";
  const bool is_amd = cpuinfo("vendor_id").contains("AuthenticAMD");
  const bool multiplies = flags.contains("avx512_bf16");
  EXPECT_EQ(multiplies_in_bfloat16(torch::kCPU), multiplies);
  EXPECT_EQ(bfloat16_is_fast(torch::kCPU), multiplies && (is_amd || flags.contains("amx_bf16")));
}

TEST(MixedPrecisionChoice, TakesBfloat16OnEveryGpu) {
  EXPECT_TRUE(multiplies_in_bfloat16(torch::kCUDA));
  EXPECT_TRUE(bfloat16_is_fast(torch::kCUDA));
}

}  // namespace
}  // namespace q3d::model
