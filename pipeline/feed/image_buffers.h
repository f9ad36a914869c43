// Provides memory for the pictures of training batches. It is reused when a batch is destroyed.
#pragma once

#include <cstddef>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

namespace q3d::pipeline::feed {

// A batch of 48 pictures is 38 MB. New memory of that size comes from the system, which clears every page;
// this would take a third of the feed's time.
//
// Thread-safe. A buffer may outlive this object.
class ImageBuffers {
  struct Unused {
    std::mutex mutex;
    std::vector<std::unique_ptr<float[]>> buffers;  // has room for all buffers that were ever made
    std::size_t made = 0;
  };
  class GiveBack {
   public:
    GiveBack() = default;
    explicit GiveBack(std::shared_ptr<Unused> unused) : unused_(std::move(unused)) {}
    void operator()(float* numbers) const noexcept;

   private:
    std::shared_ptr<Unused> unused_;
  };

 public:
  using Buffer = std::unique_ptr<float[], GiveBack>;

  // Every buffer holds this many numbers.
  explicit ImageBuffers(std::size_t numbers) : numbers_(numbers) {}

  // Returns a buffer with arbitrary numbers.
  Buffer take() const;

 private:
  std::size_t numbers_;
  std::shared_ptr<Unused> unused_ = std::make_shared<Unused>();
};

}  // namespace q3d::pipeline::feed
