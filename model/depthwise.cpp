#include "model/depthwise.h"

#include <ATen/Parallel.h>

#include <algorithm>
#include <vector>

#include "model/vectorised.h"

namespace q3d::model {
namespace {

// Channels that a loop treats together: four registers of AVX-512 hold their sums.
constexpr std::int64_t kLanes = 64;

// sums[c] += left[n][c] * right[n * step][c] for `count` pixels n.
Q3D_VECTORISED void add_products(float* sums, const float* left, const float* right, std::int64_t count,
                                 std::int64_t step) {
  std::array<float, kLanes> own{};
  for (std::int64_t n = 0; n < count; ++n) {
    const float* a = left + n * kLanes;
    const float* b = right + n * step * kLanes;
    for (std::int64_t c = 0; c < kLanes; ++c) own[c] += a[c] * b[c];
  }
  for (std::int64_t c = 0; c < kLanes; ++c) sums[c] += own[c];
}

// to[n * step][c] += from[n][c] * factors[c] for `count` pixels n.
Q3D_VECTORISED void add_scaled(float* to, const float* from, const float* factors, std::int64_t count,
                               std::int64_t step) {
  for (std::int64_t n = 0; n < count; ++n) {
    float* a = to + n * step * kLanes;
    const float* b = from + n * kLanes;
    for (std::int64_t c = 0; c < kLanes; ++c) a[c] += b[c] * factors[c];
  }
}

Q3D_VECTORISED void convert(float* to, const c10::BFloat16* from, std::int64_t count) {
  for (std::int64_t c = 0; c < count; ++c) to[c] = c10::detail::f32_from_bits(from[c].x);
}

// Rounds to the nearest, ties to even. Numbers that are not finite stay so.
Q3D_VECTORISED void convert(c10::BFloat16* to, const float* from, std::int64_t count) {
  for (std::int64_t c = 0; c < count; ++c) to[c].x = c10::detail::round_to_nearest_even(from[c]);
}

void convert(float* to, const float* from, std::int64_t count) {
  std::copy_n(from, count, to);
}

// Channels-last maps, of which a block of at most kLanes channels is looked at.
template <typename T>
struct Maps {
  T* data;
  std::int64_t height, width, channels;

  T* pixel(std::int64_t sample, std::int64_t row, std::int64_t column, std::int64_t channel) const {
    return data + ((sample * height + row) * width + column) * channels + channel;
  }
};

template <typename T>
Maps<const T> maps_of(const torch::Tensor& tensor) {
  return {tensor.const_data_ptr<T>(), tensor.size(2), tensor.size(3), tensor.size(1)};
}

// One row of one sample in float32, kLanes numbers a pixel. Nothing reads the lanes beyond the last channel.
class Row {
 public:
  explicit Row(std::int64_t width) : numbers_(static_cast<std::size_t>(width * kLanes)) {}

  template <typename T>
  void load(const Maps<T>& maps, std::int64_t sample, std::int64_t row, std::int64_t channel) {
    const std::int64_t count = std::min(kLanes, maps.channels - channel);
    for (std::int64_t x = 0; x < maps.width; ++x) convert(at(x), maps.pixel(sample, row, x, channel), count);
  }

  template <typename T>
  void store(const Maps<T>& maps, std::int64_t sample, std::int64_t row, std::int64_t channel) const {
    const std::int64_t count = std::min(kLanes, maps.channels - channel);
    for (std::int64_t x = 0; x < maps.width; ++x) {
      convert(maps.pixel(sample, row, x, channel), numbers_.data() + x * kLanes, count);
    }
  }

  void clear() { std::fill(numbers_.begin(), numbers_.end(), 0.0F); }
  float* at(std::int64_t column) { return numbers_.data() + column * kLanes; }

 private:
  std::vector<float> numbers_;
};

// The output columns whose input column, at offset `tap` of the kernel, lies inside the maps.
struct Columns {
  std::int64_t first_out, first_in, count;
};

Columns columns_of(std::int64_t tap, const ConvolutionShape& shape, std::int64_t in, std::int64_t out) {
  const std::int64_t offset = tap - shape.before;  // in = out * stride + offset
  const std::int64_t first = offset >= 0 ? 0 : (-offset + shape.stride - 1) / shape.stride;
  const std::int64_t end = std::min(out, offset >= in ? 0 : (in - 1 - offset) / shape.stride + 1);
  return {first, first * shape.stride + offset, std::max<std::int64_t>(0, end - first)};
}

// The kernel's numbers of a block of channels: (side * side, kLanes).
std::vector<float> kernel_block(const float* weight, const ConvolutionShape& shape, std::int64_t channel,
                                std::int64_t channels) {
  const std::int64_t taps = shape.side * shape.side;
  std::vector<float> block(static_cast<std::size_t>(taps * kLanes));
  for (std::int64_t c = 0; c < std::min(kLanes, channels - channel); ++c) {
    for (std::int64_t tap = 0; tap < taps; ++tap) {
      block[static_cast<std::size_t>(tap * kLanes + c)] = weight[(channel + c) * taps + tap];
    }
  }
  return block;
}

// Adds one row of the output's gradient to the sums of the kernel, (side * side, kLanes).
template <typename T>
void add_row_to_kernel(std::vector<float>& sums, Row& gradient, Row& input, const Maps<const T>& maps,
                       const ConvolutionShape& shape, std::int64_t sample, std::int64_t row,
                       std::int64_t channel, std::int64_t out_width) {
  for (std::int64_t i = 0; i < shape.side; ++i) {
    const std::int64_t in_row = row * shape.stride + i - shape.before;
    if (in_row < 0 || in_row >= maps.height) continue;
    input.load(maps, sample, in_row, channel);
    for (std::int64_t j = 0; j < shape.side; ++j) {
      const Columns columns = columns_of(j, shape, maps.width, out_width);
      add_products(sums.data() + (i * shape.side + j) * kLanes, gradient.at(columns.first_out),
                   input.at(columns.first_in), columns.count, shape.stride);
    }
  }
}

// Gradients of the kernel (C, 1, side, side) and of the bias (C), both float32.
template <typename T>
std::pair<torch::Tensor, torch::Tensor> parameter_gradients(const torch::Tensor& gradient,
                                                            const torch::Tensor& input,
                                                            const ConvolutionShape& shape) {
  const auto g = maps_of<T>(gradient);
  const auto x = maps_of<T>(input);
  const std::int64_t taps = shape.side * shape.side;
  const torch::Tensor weight = torch::empty({g.channels, 1, shape.side, shape.side}, torch::kFloat32);
  const torch::Tensor bias = torch::empty({g.channels}, torch::kFloat32);
  at::parallel_for(0, (g.channels + kLanes - 1) / kLanes, 1, [&](std::int64_t first, std::int64_t end) {
    Row gradient_row(g.width), input_row(x.width);
    const std::vector<float> ones(static_cast<std::size_t>(kLanes * g.width), 1.0F);
    for (std::int64_t block = first; block < end; ++block) {
      const std::int64_t channel = block * kLanes;
      std::vector<float> sums(static_cast<std::size_t>((taps + 1) * kLanes));
      for (std::int64_t sample = 0; sample < gradient.size(0); ++sample) {
        for (std::int64_t row = 0; row < g.height; ++row) {
          gradient_row.load(g, sample, row, channel);
          add_products(sums.data() + taps * kLanes, gradient_row.at(0), ones.data(), g.width, 1);
          add_row_to_kernel<T>(sums, gradient_row, input_row, x, shape, sample, row, channel, g.width);
        }
      }
      for (std::int64_t c = 0; c < std::min(kLanes, g.channels - channel); ++c) {
        for (std::int64_t tap = 0; tap < taps; ++tap) {
          weight.data_ptr<float>()[(channel + c) * taps + tap] =
              sums[static_cast<std::size_t>(tap * kLanes + c)];
        }
        bias.data_ptr<float>()[channel + c] = sums[static_cast<std::size_t>(taps * kLanes + c)];
      }
    }
  });
  return {weight, bias};
}

// Gradient of the maps, of their dtype.
template <typename T>
torch::Tensor map_gradient(const torch::Tensor& gradient, const torch::Tensor& input,
                           const torch::Tensor& weight, const ConvolutionShape& shape) {
  const torch::Tensor result = torch::empty_like(input, torch::MemoryFormat::ChannelsLast);
  const auto g = maps_of<T>(gradient);
  const Maps<T> out{result.data_ptr<T>(), result.size(2), result.size(3), result.size(1)};
  const torch::Tensor kernel = weight.to(torch::kFloat32).contiguous();
  at::parallel_for(0, (g.channels + kLanes - 1) / kLanes, 1, [&](std::int64_t first, std::int64_t end) {
    Row gradient_row(g.width), input_row(out.width);
    for (std::int64_t block = first; block < end; ++block) {
      const std::int64_t channel = block * kLanes;
      const std::vector<float> factors = kernel_block(kernel.data_ptr<float>(), shape, channel, g.channels);
      for (std::int64_t sample = 0; sample < input.size(0); ++sample) {
        for (std::int64_t row = 0; row < out.height; ++row) {
          input_row.clear();
          for (std::int64_t i = 0; i < shape.side; ++i) {
            const std::int64_t strided = row + shape.before - i;
            if (strided < 0 || strided % shape.stride != 0 || strided / shape.stride >= g.height) continue;
            gradient_row.load(g, sample, strided / shape.stride, channel);
            for (std::int64_t j = 0; j < shape.side; ++j) {
              const Columns columns = columns_of(j, shape, out.width, g.width);
              add_scaled(input_row.at(columns.first_in), gradient_row.at(columns.first_out),
                         factors.data() + (i * shape.side + j) * kLanes, columns.count, shape.stride);
            }
          }
          input_row.store(out, sample, row, channel);
        }
      }
    }
  });
  return result;
}

template <typename T>
ConvolutionGradients gradients_as(const torch::Tensor& gradient, const torch::Tensor& maps,
                                  const torch::Tensor& weight, const ConvolutionShape& shape,
                                  const std::array<bool, 3>& needed) {
  ConvolutionGradients result;
  if (needed[0]) result.maps = map_gradient<T>(gradient, maps, weight, shape);
  if (needed[1] || needed[2]) {
    const auto [of_weight, of_bias] = parameter_gradients<T>(gradient, maps, shape);
    if (needed[1]) result.weight = of_weight.to(weight.scalar_type());
    if (needed[2]) result.bias = of_bias.to(weight.scalar_type());
  }
  return result;
}

}  // namespace

ConvolutionGradients depthwise_gradients(const torch::Tensor& gradient, const torch::Tensor& maps,
                                         const torch::Tensor& weight, const ConvolutionShape& shape,
                                         const std::array<bool, 3>& needed) {
  const torch::Tensor own_maps = maps.contiguous(at::MemoryFormat::ChannelsLast);
  const torch::Tensor own_gradient = gradient.contiguous(at::MemoryFormat::ChannelsLast);
  return maps.scalar_type() == torch::kFloat32
             ? gradients_as<float>(own_gradient, own_maps, weight, shape, needed)
             : gradients_as<c10::BFloat16>(own_gradient, own_maps, weight, shape, needed);
}

}  // namespace q3d::model
