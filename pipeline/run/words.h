// Makes plurals in messages.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace q3d::pipeline::run {

// Returns "1 shard", "2 shards". The plural is the singular with an "s" unless it is given.
std::string counted(std::int64_t count, std::string_view singular, std::string_view plural = {});

}  // namespace q3d::pipeline::run
