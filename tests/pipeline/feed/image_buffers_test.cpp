#include "pipeline/feed/image_buffers.h"

#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <set>
#include <thread>
#include <vector>

namespace q3d::pipeline::feed {
namespace {

TEST(ImageBuffers, GivesABufferAgainOnceItIsReturned) {
  const ImageBuffers buffers(8);
  ImageBuffers::Buffer first = buffers.take();
  const ImageBuffers::Buffer second = buffers.take();
  EXPECT_NE(first.get(), second.get());
  const float* returned = first.get();
  first.reset();
  // Had the memory been freed, this would take it.
  const auto other = std::make_unique_for_overwrite<float[]>(8);
  EXPECT_NE(other.get(), returned);
  EXPECT_EQ(buffers.take().get(), returned);
}

TEST(ImageBuffers, ABufferOutlivesThePool) {
  std::optional<ImageBuffers> buffers(8);
  const ImageBuffers::Buffer buffer = buffers->take();
  buffers.reset();
  buffer[7] = 1.0F;
  EXPECT_EQ(buffer[7], 1.0F);
}

TEST(ImageBuffers, ThreadsNeverShareABuffer) {
  const ImageBuffers buffers(1);
  std::vector<std::jthread> threads;
  threads.reserve(4);
  for (int thread = 0; thread < 4; ++thread) {
    threads.emplace_back([&buffers, thread] {
      for (int round = 0; round < 2000; ++round) {
        const ImageBuffers::Buffer mine = buffers.take();
        mine[0] = static_cast<float>(thread);
        std::this_thread::yield();
        ASSERT_EQ(mine[0], static_cast<float>(thread));
      }
    });
  }
  threads.clear();
  std::set<const float*> made;
  std::vector<ImageBuffers::Buffer> held;
  for (int i = 0; i < 4; ++i) made.insert(held.emplace_back(buffers.take()).get());
  EXPECT_EQ(made.size(), 4U);
}

}  // namespace
}  // namespace q3d::pipeline::feed
