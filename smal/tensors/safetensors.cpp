#include "smal/tensors/safetensors.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cstring>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string_view>

#include "smal/tensors/safetensors_header.h"

static_assert(std::endian::native == std::endian::little, "safetensors files are little-endian");

namespace q3d::smal::tensors {
namespace {

// File layout: 8-byte little-endian length N, N bytes of JSON, then the tensors' bytes without holes.
constexpr std::uint64_t kLengthBytes = 8;
constexpr std::uint64_t kMaxHeaderBytes = 100'000'000;  // the format's own limit

std::string system_reason() {
  return std::strerror(errno);
}

// A pickle starts with 0x80 and its protocol, 2 to 5. The length of a safetensors header may start with the
// same bytes, but a brace follows it.
bool is_pickle(std::string_view content) {
  const bool has_header = content.size() > kLengthBytes && content[kLengthBytes] == '{';
  return content.size() >= 2 && content[0] == '\x80' && content[1] >= 2 && content[1] <= 5 && !has_header;
}

// Says what the file is if it holds weights in another form, and how they are imported; else "".
std::string other_form(std::string_view content) {
  constexpr const char* kImport =
      "got {}, expected safetensors: import it with tools/import_assets.py (docs/assets.md)";
  if (content.starts_with("PK\3\4")) {
    return fmt::format(fmt::runtime(kImport), "a PyTorch file, such as a Lightning checkpoint (.ckpt)");
  }
  if (is_pickle(content)) return fmt::format(fmt::runtime(kImport), "a Python pickle (.pkl, .pt, .pth)");
  if (content.starts_with("version https://git-lfs")) return "got a Git LFS pointer: run `git lfs pull`";
  return {};
}

class FileDescriptor {
 public:
  explicit FileDescriptor(int fd) : fd_(fd) {}
  ~FileDescriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  FileDescriptor(const FileDescriptor&) = delete;
  FileDescriptor& operator=(const FileDescriptor&) = delete;
  int get() const { return fd_; }
  int close() { return ::close(std::exchange(fd_, -1)); }

 private:
  int fd_;
};

}  // namespace

struct SafeTensors::Mapping {
  std::filesystem::path path;
  const char* bytes = nullptr;
  std::uint64_t size = 0;
  std::uint64_t data_start = 0;
  TensorFileHeader header;

  Mapping() = default;
  Mapping(const Mapping&) = delete;
  Mapping& operator=(const Mapping&) = delete;
  ~Mapping() {
    if (bytes != nullptr) ::munmap(const_cast<char*>(bytes), size);
  }

  void map_file() {
    // O_NONBLOCK is set because opening a named pipe would otherwise wait for a writer.
    const FileDescriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
    if (file.get() < 0) throw std::runtime_error("cannot open: " + system_reason());
    struct stat status {};
    if (::fstat(file.get(), &status) != 0) throw std::runtime_error("cannot stat: " + system_reason());
    if (!S_ISREG(status.st_mode)) throw std::runtime_error("not a regular file");
    size = static_cast<std::uint64_t>(status.st_size);
    if (size < kLengthBytes) {
      throw std::runtime_error(fmt::format("{} bytes, expected at least {}", size, kLengthBytes));
    }
    void* mapped = ::mmap(nullptr, size, PROT_READ, MAP_PRIVATE, file.get(), 0);
    if (mapped == MAP_FAILED) throw std::runtime_error("cannot map: " + system_reason());
    bytes = static_cast<const char*>(mapped);
  }

  void read_header() {
    if (const std::string other = other_form({bytes, static_cast<std::size_t>(size)}); !other.empty()) {
      throw std::runtime_error(other);
    }
    std::uint64_t header_bytes = 0;
    std::memcpy(&header_bytes, bytes, kLengthBytes);
    if (header_bytes > kMaxHeaderBytes) {
      throw std::runtime_error(
          fmt::format("a header of {} bytes, expected at most {}", header_bytes, kMaxHeaderBytes));
    }
    if (header_bytes > size - kLengthBytes) {
      throw std::runtime_error(fmt::format("a header of {} bytes in a file of {} bytes", header_bytes, size));
    }
    data_start = kLengthBytes + header_bytes;
    header = parse_header({bytes + kLengthBytes, header_bytes}, size - data_start);
  }
};

SafeTensors SafeTensors::open(const std::filesystem::path& path) {
  auto mapping = std::make_shared<Mapping>();
  mapping->path = path;
  try {
    mapping->map_file();
    mapping->read_header();
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(path.string() + ": not a usable safetensors file: " + error.what());
  }
  SafeTensors result;
  result.mapping_ = std::move(mapping);
  return result;
}

const std::filesystem::path& SafeTensors::path() const {
  return mapping_->path;
}

const std::map<std::string, std::string>& SafeTensors::metadata() const {
  return mapping_->header.metadata;
}

std::vector<std::string> SafeTensors::names() const {
  std::vector<std::string> result;
  for (const auto& [name, entry] : mapping_->header.entries) result.push_back(name);
  return result;
}

bool SafeTensors::contains(const std::string& name) const {
  return mapping_->header.entries.count(name) > 0;
}

torch::Tensor SafeTensors::tensor(const std::string& name) const {
  const auto found = mapping_->header.entries.find(name);
  if (found == mapping_->header.entries.end()) {
    throw std::runtime_error(mapping_->path.string() + ": no tensor named " + quote_name(name));
  }
  const TensorEntry& entry = found->second;
  const char* data = mapping_->bytes + mapping_->data_start + entry.begin;
  const auto options = torch::TensorOptions().dtype(entry.dtype);
  if (entry.dtype == torch::kBool &&
      std::any_of(data, data + (entry.end - entry.begin), [](char byte) { return byte != 0 && byte != 1; })) {
    throw std::runtime_error(mapping_->path.string() + ": entry " + quote_name(name) +
                             ": a BOOL that is neither 0 nor 1");
  }
  // The format aligns nothing, and a misaligned or empty range cannot be shared.
  if (entry.begin == entry.end ||
      reinterpret_cast<std::uintptr_t>(data) % torch::elementSize(entry.dtype) != 0) {
    torch::Tensor copy = torch::empty(entry.shape, options);
    if (copy.numel() > 0) std::memcpy(copy.data_ptr(), data, entry.end - entry.begin);
    return copy;
  }
  // The deleter owns a share of the mapping, and so keeps the pages alive as long as the tensor.
  return torch::from_blob(
      const_cast<char*>(data), entry.shape, [keep = mapping_](void*) {}, options);
}

namespace {

std::string header_text(const NamedTensors& tensors, const std::map<std::string, std::string>& metadata) {
  nlohmann::ordered_json header = nlohmann::ordered_json::object();
  if (!metadata.empty()) header[kMetadataKey] = metadata;
  std::uint64_t reached = 0;
  for (const auto& [name, tensor] : tensors) {
    if (name == kMetadataKey || header.contains(name)) {
      throw std::runtime_error("the name " + quote_name(name) + " is reserved or appears twice");
    }
    const std::uint64_t end = reached + tensor.nbytes();
    header[name] = {{"dtype", dtype_name(tensor.scalar_type())},
                    {"shape", tensor.sizes().vec()},
                    {"data_offsets", {reached, end}}};
    reached = end;
  }
  std::string text = header.dump();
  text.append((8 - text.size() % 8) % 8, ' ');  // so that the data starts aligned
  return text;
}

void write_all(int fd, const void* data, std::size_t bytes) {
  const char* next = static_cast<const char*>(data);
  while (bytes > 0) {
    const ssize_t written = ::write(fd, next, bytes);
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) throw std::runtime_error("cannot write: " + system_reason());
    next += written;
    bytes -= static_cast<std::size_t>(written);
  }
}

// The steps of manifests/atomic_file.h, which this room does not see: it links no other room than smal.
void sync_file(int fd) {
  while (::fsync(fd) != 0) {
    if (errno != EINTR) {
      throw std::runtime_error("cannot make it durable: " + system_reason() +
                               "; if the disk cannot do this, give --no-sync");
    }
  }
}

void write_file(const std::filesystem::path& path, const NamedTensors& tensors, const std::string& header,
                Sync sync) {
  constexpr std::string_view kEnding = ".tmp";  // as manifests::remove_temporaries knows it
  std::string temporary = path.string() + ".XXXXXX" + std::string(kEnding);
  FileDescriptor file(::mkstemps(temporary.data(), static_cast<int>(kEnding.size())));
  if (file.get() < 0)
    throw std::runtime_error("cannot create a temporary file beside it: " + system_reason());
  try {
    const std::uint64_t header_bytes = header.size();
    write_all(file.get(), &header_bytes, kLengthBytes);
    write_all(file.get(), header.data(), header.size());
    for (const auto& [name, tensor] : tensors) write_all(file.get(), tensor.data_ptr(), tensor.nbytes());
    if (sync == Sync::yes) sync_file(file.get());
    if (::fchmod(file.get(), 0644) != 0 || file.close() != 0) {
      throw std::runtime_error("cannot finish: " + system_reason());
    }
    if (::rename(temporary.c_str(), path.c_str()) != 0) {
      throw std::runtime_error("cannot rename: " + system_reason());
    }
  } catch (...) {
    ::unlink(temporary.c_str());
    throw;
  }
}

// Makes the rename itself durable.
void sync_folder(const std::filesystem::path& path) {
  const std::filesystem::path folder = path.has_parent_path() ? path.parent_path() : ".";
  const FileDescriptor handle(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (handle.get() < 0) throw std::runtime_error("cannot open its folder: " + system_reason());
  sync_file(handle.get());
}

}  // namespace

void write_safetensors(const std::filesystem::path& path, const NamedTensors& tensors,
                       const std::map<std::string, std::string>& metadata, Sync sync) {
  try {
    NamedTensors plain;
    for (const auto& [name, tensor] : tensors) {
      if (!tensor.defined()) throw std::runtime_error("tensor " + quote_name(name) + " is undefined");
      plain.emplace_back(name, tensor.detach().to(torch::kCPU).contiguous());
    }
    write_file(path, plain, header_text(plain, metadata), sync);
    if (sync == Sync::yes) sync_folder(path);
  } catch (const std::exception& error) {
    throw std::runtime_error(path.string() + ": cannot write the safetensors file: " + error.what());
  }
}

}  // namespace q3d::smal::tensors
