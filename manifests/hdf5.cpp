#include "manifests/hdf5.h"

#include <fmt/format.h>

#include <algorithm>
#include <new>
#include <stdexcept>

namespace q3d::manifests::hdf5 {
namespace {

std::mutex& library_mutex() {
  static std::mutex mutex;
  return mutex;
}

herr_t take_innermost(unsigned depth, const H5E_error2_t* error, void* out) {
  if (depth == 0 && error->desc != nullptr) *static_cast<std::string*>(out) = error->desc;
  return 0;
}

// This must not throw, because no exception may cross the library.
herr_t take_name(hid_t, const char* name, const H5L_info_t*, void* out) try {
  static_cast<std::vector<std::string>*>(out)->emplace_back(name);
  return 0;
} catch (const std::bad_alloc&) {
  return -1;
}

}  // namespace

Session::Session() : lock_(library_mutex()) {
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
}

void throw_error(const std::string& what) {
  std::string reason = "no reason given";
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, take_innermost, &reason);
  H5Eclear2(H5E_DEFAULT);
  throw std::runtime_error(fmt::format("{}: {}", what, reason));
}

std::vector<std::string> link_names(hid_t group, const std::string& what) {
  std::vector<std::string> names;
  check(H5Literate(group, H5_INDEX_NAME, H5_ITER_NATIVE, nullptr, take_name, &names), what);
  std::sort(names.begin(), names.end());
  return names;
}

}  // namespace q3d::manifests::hdf5
