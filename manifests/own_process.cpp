#include "manifests/own_process.h"

#include <fmt/format.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <system_error>

namespace q3d::manifests {
namespace {

// The first byte of the answer is one of these. The rest is the value, or the reason why there is none.
constexpr char kValue = 'v';
constexpr char kRefusal = 'r';

[[noreturn]] void throw_errno(const char* what) {
  throw std::system_error(errno, std::generic_category(), what);
}

// Returns false if the reader is gone.
bool write_all(int descriptor, const std::string& bytes) {
  std::size_t at = 0;
  while (at < bytes.size()) {
    const ssize_t written = write(descriptor, bytes.data() + at, bytes.size() - at);
    if (written < 0 && errno != EINTR) return false;
    if (written > 0) at += static_cast<std::size_t>(written);
  }
  return true;
}

std::string read_all(int descriptor) {
  std::string bytes;
  std::array<char, 65536> part{};
  while (true) {
    const ssize_t got = read(descriptor, part.data(), part.size());
    if (got < 0 && errno != EINTR) throw_errno("read from a process of its own");
    if (got == 0) return bytes;
    if (got > 0) bytes.append(part.data(), static_cast<std::size_t>(got));
  }
}

[[noreturn]] void run_child(const std::function<std::string()>& work, std::chrono::seconds limit,
                            int answer) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  const rlimit no_core{0, 0};
  setrlimit(RLIMIT_CORE, &no_core);
  for (const int signal : {SIGALRM, SIGSEGV, SIGBUS, SIGABRT, SIGPIPE}) std::signal(signal, SIG_DFL);
  alarm(static_cast<unsigned>(limit.count()));
  std::string message;
  try {
    message = kValue + work();
  } catch (const std::exception& error) {
    message = kRefusal + std::string(error.what());
  }
  _exit(write_all(answer, message) ? EXIT_SUCCESS : EXIT_FAILURE);
}

int wait_for(pid_t child) {
  int status = 0;
  while (waitpid(child, &status, 0) < 0) {
    if (errno != EINTR) throw_errno("waitpid");
  }
  return status;
}

struct Answer {
  std::string content;       // the first byte is the kind of the answer
  std::string how_it_ended;  // empty if the child came to its end
};

Answer answer_of_child(const std::function<std::string()>& work, std::chrono::seconds limit) {
  std::array<int, 2> ends{};
  if (pipe(ends.data()) != 0) throw_errno("pipe");
  const pid_t child = fork();
  if (child == 0) {
    close(ends[0]);
    run_child(work, limit, ends[1]);
  }
  close(ends[1]);
  if (child < 0) {
    close(ends[0]);
    throw_errno("fork");
  }
  Answer answer{read_all(ends[0]), {}};
  close(ends[0]);
  const int status = wait_for(child);
  if (WIFSIGNALED(status)) {
    answer.how_it_ended =
        WTERMSIG(status) == SIGALRM
            ? fmt::format("reading took more than {} s and was stopped", limit.count())
            : fmt::format("the library that reads it crashed ({}), which happens with damaged files",
                          strsignal(WTERMSIG(status)));
  } else if (!WIFEXITED(status) || WEXITSTATUS(status) != EXIT_SUCCESS || answer.content.empty()) {
    answer.how_it_ended =
        fmt::format("the process that reads it ended with status {} and gave no answer", WEXITSTATUS(status));
  }
  return answer;
}

}  // namespace

std::string in_own_process(const std::function<std::string()>& work, std::chrono::seconds limit) {
  Answer answer = answer_of_child(work, limit);
  if (!answer.how_it_ended.empty()) throw std::runtime_error(answer.how_it_ended);
  const bool is_value = answer.content.front() == kValue;
  answer.content.erase(0, 1);
  if (!is_value) throw std::runtime_error(answer.content);
  return std::move(answer.content);
}

std::optional<std::string> trial_in_own_process(const std::function<void()>& work,
                                                std::chrono::seconds limit) {
  const auto silent = [&work] {
    work();
    return std::string();
  };
  Answer answer = answer_of_child(silent, limit);
  if (answer.how_it_ended.empty()) return std::nullopt;
  return std::move(answer.how_it_ended);
}

}  // namespace q3d::manifests
