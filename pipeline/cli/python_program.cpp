#include "pipeline/cli/python_program.h"

#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <stdexcept>

namespace q3d::pipeline::cli {
namespace {

constexpr int kFailure = 1;
constexpr int kNotStarted = 127;

std::vector<char*> pointers(std::vector<std::string>& words) {
  std::vector<char*> result;
  for (std::string& word : words) result.push_back(word.data());
  result.push_back(nullptr);
  return result;
}

// Returns everything that arrives before the other end is closed.
std::string read_all(int descriptor) {
  std::string text;
  std::array<char, 4096> block{};
  while (true) {
    const ssize_t count = ::read(descriptor, block.data(), block.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return text;
    text.append(block.data(), static_cast<std::size_t>(count));
  }
}

std::string last_line(const std::string& text) {
  const std::size_t end = text.find_last_not_of('\n');
  if (end == std::string::npos) return "";
  const std::size_t start = text.find_last_of('\n', end);
  return text.substr(start == std::string::npos ? 0 : start + 1,
                     end - (start == std::string::npos ? 0 : start + 1) + 1);
}

}  // namespace

PythonCheck check_python(const std::string& python, const std::string& module) {
  std::array<int, 2> pipe{};
  if (::pipe(pipe.data()) != 0) throw std::runtime_error(fmt::format("pipe: {}", std::strerror(errno)));
  std::vector<std::string> words{python, "-c", "import " + module};
  const std::vector<char*> arguments = pointers(words);
  const pid_t child = ::fork();
  if (child < 0) throw std::runtime_error(fmt::format("fork: {}", std::strerror(errno)));
  if (child == 0) {
    ::dup2(pipe[1], STDERR_FILENO);
    ::close(pipe[0]);
    ::close(pipe[1]);
    ::execvp(arguments[0], arguments.data());
    const std::string_view reason = std::strerror(errno);
    [[maybe_unused]] const ssize_t written = ::write(STDERR_FILENO, reason.data(), reason.size());
    ::_exit(kNotStarted);
  }
  ::close(pipe[1]);
  const std::string said = read_all(pipe[0]);
  ::close(pipe[0]);
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return {WIFEXITED(status) && WEXITSTATUS(status) == 0, last_line(said)};
}

int become_python(const std::string& python, const std::string& module,
                  const std::vector<std::string>& words) {
  std::vector<std::string> all{python, "-m", module};
  all.insert(all.end(), words.begin(), words.end());
  const std::vector<char*> arguments = pointers(all);
  ::execvp(arguments[0], arguments.data());
  fmt::print(stderr, "quadruped3d: cannot start {}: {}\n", python, std::strerror(errno));
  return kFailure;
}

}  // namespace q3d::pipeline::cli
