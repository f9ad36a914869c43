// The one seam to the HDF5 C library: handles that close themselves, calls that are checked, one lock.
#pragma once

#include <hdf5.h>

#include <mutex>
#include <string>
#include <utility>
#include <vector>

namespace q3d::manifests::hdf5 {

// Every call into HDF5, closing handles included, happens while a Session lives: the library has global state
// and, depending on how it was built, no lock of its own. It also stops HDF5 from printing its error stack.
class Session {
 public:
  Session();

 private:
  std::unique_lock<std::mutex> lock_;
};

// Throws std::runtime_error "<what>: <the library's innermost reason>".
[[noreturn]] void throw_error(const std::string& what);

// Passes a non-negative result on; throws as above for a negative one.
template <typename Result>
Result check(Result result, const std::string& what) {
  if (result < 0) throw_error(what);
  return result;
}

class Handle {
 public:
  // Takes ownership of `id`, which `closer` will close. Throws as above when it is negative.
  Handle(hid_t id, herr_t (*closer)(hid_t), const std::string& what) : id_(check(id, what)), close_(closer) {}
  ~Handle() {
    if (id_ >= 0) close_(id_);
  }
  Handle(Handle&& other) noexcept : id_(std::exchange(other.id_, -1)), close_(other.close_) {}
  Handle& operator=(Handle&&) = delete;
  hid_t get() const { return id_; }
  // Closes now; throws as above when that fails, which for a file means that it is incomplete.
  void close(const std::string& what) { check(close_(std::exchange(id_, -1)), what); }

 private:
  hid_t id_;
  herr_t (*close_)(hid_t);
};

// The names in a group, sorted. Throws as check() does.
//
// HDF5 1.10 frees memory that it never set when a damaged group cannot be listed by index, or in another
// order than the file's own; so this walks in native order, and other code should not list by index either.
std::vector<std::string> link_names(hid_t group, const std::string& what);

}  // namespace q3d::manifests::hdf5
