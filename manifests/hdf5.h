// The only interface to the HDF5 C library: handles that close themselves, checked calls, and one lock.
#pragma once

#include <hdf5.h>

#include <mutex>
#include <string>
#include <utility>
#include <vector>

namespace q3d::manifests::hdf5 {

// A Session must exist during every call into HDF5, including the closing of handles. The library has global
// state and, depending on how it was built, no lock of its own. A Session also stops HDF5 from printing its
// error stack.
class Session {
 public:
  Session();

 private:
  std::unique_lock<std::mutex> lock_;
};

// Throws std::runtime_error with the text "<what>: <the library's innermost reason>".
[[noreturn]] void throw_error(const std::string& what);

// Returns a result that is not negative; throws like throw_error() for a negative one.
template <typename Result>
Result check(Result result, const std::string& what) {
  if (result < 0) throw_error(what);
  return result;
}

class Handle {
 public:
  // Takes ownership of `id`, which `closer` will close. Throws like throw_error() if `id` is negative.
  Handle(hid_t id, herr_t (*closer)(hid_t), const std::string& what) : id_(check(id, what)), close_(closer) {}
  ~Handle() {
    if (id_ >= 0) close_(id_);
  }
  Handle(Handle&& other) noexcept : id_(std::exchange(other.id_, -1)), close_(other.close_) {}
  Handle& operator=(Handle&&) = delete;
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  hid_t get() const { return id_; }
  // Closes now. Throws like throw_error() if this fails, which for a file means that it is incomplete.
  void close(const std::string& what) { check(close_(std::exchange(id_, -1)), what); }

 private:
  hid_t id_;
  herr_t (*close_)(hid_t);
};

// Returns the names in a group, sorted. Throws like check().
//
// HDF5 1.10 frees memory that it never set when a damaged group cannot be listed by index, or in an order
// other than the file's own. Therefore this function walks in native order, and other code should not list by
// index either.
std::vector<std::string> link_names(hid_t group, const std::string& what);

}  // namespace q3d::manifests::hdf5
