#include "pipeline/feed/image_buffers.h"

#include <utility>

namespace q3d::pipeline::feed {

void ImageBuffers::GiveBack::operator()(float* numbers) const noexcept {
  std::unique_ptr<float[]> buffer(numbers);
  const std::scoped_lock lock(unused_->mutex);
  unused_->buffers.push_back(std::move(buffer));
}

ImageBuffers::Buffer ImageBuffers::take() const {
  const std::scoped_lock lock(unused_->mutex);
  if (unused_->buffers.empty()) {
    unused_->buffers.reserve(unused_->made + 1);
    Buffer fresh(std::make_unique_for_overwrite<float[]>(numbers_).release(), GiveBack(unused_));
    ++unused_->made;
    return fresh;
  }
  Buffer used(unused_->buffers.back().release(), GiveBack(unused_));
  unused_->buffers.pop_back();
  return used;
}

}  // namespace q3d::pipeline::feed
