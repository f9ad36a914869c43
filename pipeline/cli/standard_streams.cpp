#include "pipeline/cli/standard_streams.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <stdexcept>
#include <string>
#include <string_view>

#include "pipeline/run/printable.h"

namespace q3d::pipeline::cli {
namespace {

// Opens the streams in ascending order, because open(2) takes the lowest free number. A stdout that was
// closed is opened read-only, so that finish_stdout() notices printed text that is lost.
void open_closed_streams() {
  constexpr std::array kStreams{STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO};
  for (const int stream : kStreams) {
    if (::fcntl(stream, F_GETFD) != -1 || errno != EBADF) continue;
    const int opened = ::open("/dev/null", stream == STDERR_FILENO ? O_WRONLY : O_RDONLY);
    if (opened != stream) _exit(1);  // no stream is left for a message
  }
}

bool write_all(int descriptor, std::string_view text) {
  while (!text.empty()) {
    const ssize_t written = ::write(descriptor, text.data(), text.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return false;
    text.remove_prefix(static_cast<std::size_t>(written));
  }
  return true;
}

ssize_t write_stderr(void*, const char* text, std::size_t size) {
  const int kept_errno = errno;
  write_all(STDERR_FILENO, run::printable_text({text, size}));
  errno = kept_errno;
  return static_cast<ssize_t>(size);
}

ssize_t write_terminal(void*, const char* text, std::size_t size) {
  return write_all(STDOUT_FILENO, run::printable_text({text, size})) ? static_cast<ssize_t>(size) : 0;
}

// The C library lets a program replace stdout and stderr by other streams. The old ones stay open for code
// that holds them.
std::FILE* stream_to(cookie_write_function_t* write, int buffering) {
  std::FILE* stream = ::fopencookie(nullptr, "w", {nullptr, write, nullptr, nullptr});
  if (stream == nullptr)
    throw std::runtime_error(fmt::format("cannot open a stream: {}", std::strerror(errno)));
  std::setvbuf(stream, nullptr, buffering, BUFSIZ);
  return stream;
}

}  // namespace

void prepare_standard_streams() {
  open_closed_streams();
  stderr = stream_to(write_stderr, _IONBF);
  if (::isatty(STDOUT_FILENO) != 0) stdout = stream_to(write_terminal, _IOLBF);
}

bool stdout_failed() {
  return std::ferror(stdout) != 0;
}

std::string unwritten_stdout(const std::string& reason) {
  return fmt::format(
      "stdout could not be written ({}), so what was printed is not complete; free some space or give "
      "another place, "
      "and run the same command again",
      reason);
}

void finish_stdout() {
  const bool is_flushed = std::fflush(stdout) == 0;
  if (is_flushed && !stdout_failed()) return;
  throw std::runtime_error(unwritten_stdout(is_flushed ? "an earlier write failed" : std::strerror(errno)));
}

}  // namespace q3d::pipeline::cli
