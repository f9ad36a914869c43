#include "pipeline/cli/local_ranks.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/signalfd.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "pipeline/cli/commands.h"
#include "pipeline/cli/network_program.h"
#include "pipeline/cli/options.h"

namespace q3d::pipeline::cli {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kFailure = 1;
constexpr int kUsage = 2;
constexpr int kSignalled = 128;  // a shell's exit code for a process that a signal ended, less the signal
// Ranks leave by themselves when rank 0, or any that is needed, has ended. Those that do not within this
// time are ended, then killed.
constexpr std::chrono::seconds kTimeToLeave{30};
constexpr std::chrono::seconds kTimeToStop{10};

[[noreturn]] void fail(const char* what) {
  throw std::system_error(errno, std::generic_category(), std::string("--ranks: cannot ") + what);
}

// Returns the text that the arguments give to an option, as in `--ranks 2` or `--ranks=2`.
std::optional<std::string_view> text_of(std::string_view option, std::span<char* const> arguments) {
  std::optional<std::string_view> text;
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    const std::string_view word = arguments[i];
    if (word == option && i + 1 < arguments.size()) text = arguments[i + 1];
    if (word.starts_with(option) && word.substr(option.size()).starts_with('='))
      text = word.substr(option.size() + 1);
  }
  return text;
}

// Returns nothing for a text that is no number from 1 to kMostRanks.
std::optional<int> number_of_ranks(std::string_view text) {
  int ranks = 0;
  const char* const last = text.data() + text.size();
  const auto [end, error] = std::from_chars(text.data(), last, ranks);
  const bool is_valid = error == std::errc() && end == last && ranks >= 1 && ranks <= kMostRanks;
  return is_valid ? std::optional(ranks) : std::nullopt;
}

// Returns the variable by which another launcher says that this process is one of several ranks already.
const char* other_launcher() {
  if (std::getenv("WORLD_SIZE") != nullptr) return "WORLD_SIZE";
  const char* tasks = std::getenv("SLURM_NTASKS");
  const bool in_step = std::getenv("SLURM_STEP_ID") != nullptr && tasks != nullptr;
  return in_step && std::strcmp(tasks, "1") != 0 ? "SLURM_NTASKS" : nullptr;
}

struct ListeningSocket {
  int descriptor = -1;
  int port = 0;
};

// Opens the socket of rank 0's store, so that no other program can take the port meanwhile.
ListeningSocket listen_on_loopback() {
  const int socket = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof(address);
  auto* const plain = reinterpret_cast<sockaddr*>(&address);
  if (socket < 0 || ::bind(socket, plain, size) != 0 || ::listen(socket, SOMAXCONN) != 0 ||
      ::getsockname(socket, plain, &size) != 0) {
    fail("open a socket for the ranks");
  }
  return {socket, ntohs(address.sin_port)};
}

struct Pipe {
  int read_end = -1;
  int write_end = -1;
};

Pipe open_pipe() {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) fail("open a pipe");
  return {ends[0], ends[1]};
}

// Holds back the signals that this process waits for, and returns a descriptor that reads them.
int hold_signals(sigset_t& before) {
  sigset_t held;
  ::sigemptyset(&held);
  for (const int number : {SIGCHLD, SIGINT, SIGTERM, SIGHUP, SIGTSTP, SIGCONT}) ::sigaddset(&held, number);
  ::sigprocmask(SIG_BLOCK, &held, &before);
  std::signal(SIGCHLD, SIG_DFL);  // a parent that ignores it would hide how the ranks end
  const int descriptor = ::signalfd(-1, &held, SFD_CLOEXEC | SFD_NONBLOCK);
  if (descriptor < 0) fail("wait for signals");
  return descriptor;
}

// Returns whether nohup has started this process.
bool ignores_hangups() {
  struct sigaction present {};
  ::sigaction(SIGHUP, nullptr, &present);
  return present.sa_handler == SIG_IGN;
}

class LocalRanks {
 public:
  LocalRanks(char** argv, const WantedRanks& ranks)
      : argv_(argv), pids_(static_cast<std::size_t>(ranks.count), 0), are_all_needed_(ranks.are_all_needed) {}

  int run() {
    start(0);
    // From here on rank 0 alone has both, so that the others see when it has ended.
    ::close(ready_.write_end);
    ::close(socket_.descriptor);
    while (are_running()) {
      wait_for_event();
      take_signals();
      if (!has_led_) start_others();
      end_stragglers();
    }
    return code_of_rank_0_;
  }

 private:
  bool is_running(std::size_t rank) const { return pids_[rank] > 0; }
  bool are_running() const {
    return std::any_of(pids_.begin(), pids_.end(), [](pid_t pid) { return pid > 0; });
  }

  void start(std::size_t rank) {
    const pid_t launcher = ::getpid();
    const pid_t pid = ::fork();
    if (pid < 0) fail("start a process");
    if (pid == 0) std::_Exit(become_rank(rank, launcher));
    pids_[rank] = pid;
    if (rank == 0) group_ = pid;
    ::setpgid(pid, group_);  // the rank does it too; whoever comes first
  }

  // Runs in the new process, and returns only if the program cannot be started.
  int become_rank(std::size_t rank, pid_t launcher) {
    // A group of their own: Ctrl-C reaches the launcher alone, which passes it on once.
    ::setpgid(0, group_);
    ::prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (::getppid() != launcher) return kFailure;
    ::sigprocmask(SIG_SETMASK, &signals_before_, nullptr);
    const std::string size = std::to_string(pids_.size());
    const std::string own = std::to_string(rank);
    for (const auto& [name, value] : {std::pair{"RANK", own},
                                      {"LOCAL_RANK", own},
                                      {"WORLD_SIZE", size},
                                      {"LOCAL_WORLD_SIZE", size},
                                      {"MASTER_ADDR", std::string("127.0.0.1")},
                                      {"MASTER_PORT", std::to_string(socket_.port)}}) {
      ::setenv(name, value.c_str(), /*replace=*/1);
    }
    ::setenv("GLOO_SOCKET_IFNAME", "lo", /*replace=*/0);  // a host's own name need not resolve
    if (rank == 0) {
      pass_on("Q3D_STORE_SOCKET", socket_.descriptor);
      pass_on("Q3D_READY_PIPE", ready_.write_end);
    }
    return become_network_program(argv_);
  }

  static void pass_on(const char* name, int descriptor) {
    ::fcntl(descriptor, F_SETFD, 0);  // stays open in the program
    ::setenv(name, std::to_string(descriptor).c_str(), /*replace=*/1);
  }

  void wait_for_event() const {
    constexpr int kMilliseconds = 1000;  // for end_stragglers()
    std::array<pollfd, 2> events{{{signals_, POLLIN, 0}, {ready_.read_end, POLLIN, 0}}};
    ::poll(events.data(), has_led_ ? 1 : 2, kMilliseconds);
  }

  // Starts the other ranks as soon as rank 0 has read its config.
  void start_others() {
    pollfd event{ready_.read_end, POLLIN, 0};
    if (::poll(&event, 1, 0) <= 0) return;
    has_led_ = true;
    char word = 0;
    const bool is_ready = ::read(ready_.read_end, &word, 1) == 1;
    if (!is_ready || is_stopping_ || !is_running(0)) return;
    for (std::size_t rank = 1; rank < pids_.size(); ++rank) start(rank);
  }

  void take_signals() {
    signalfd_siginfo signal{};
    while (::read(signals_, &signal, sizeof(signal)) == sizeof(signal)) {
      const int number = static_cast<int>(signal.ssi_signo);
      if (number == SIGCHLD) {
        reap();
      } else if (number == SIGTSTP) {
        ::kill(-group_, SIGTSTP);
        ::raise(SIGSTOP);
      } else if (number != SIGHUP || !ignores_hangups()) {
        is_stopping_ = is_stopping_ || number != SIGCONT;
        ::kill(-group_, number);
      }
    }
  }

  void reap() {
    int status = 0;
    for (pid_t pid = 0; (pid = ::waitpid(-1, &status, WNOHANG)) > 0;) {
      const auto found = std::find(pids_.begin(), pids_.end(), pid);
      if (found == pids_.end()) continue;
      *found = 0;
      note_end(static_cast<std::size_t>(found - pids_.begin()), status);
    }
  }

  void note_end(std::size_t rank, int status) {
    const int code = WIFEXITED(status) ? WEXITSTATUS(status) : kSignalled + WTERMSIG(status);
    if (rank == 0) code_of_rank_0_ = code;
    if (!deadline_ && (rank == 0 || (are_all_needed_ && code != 0))) deadline_ = Clock::now() + kTimeToLeave;
    if (!is_stopping_ && code != 0) tell_end(rank, status, code);
  }

  void tell_end(std::size_t rank, int status, int code) const {
    if (WIFSIGNALED(status)) {
      fmt::print(stderr, "quadruped3d: rank {} of {} was ended by signal {} ({}){}\n", rank, pids_.size(),
                 WTERMSIG(status), ::strsignal(WTERMSIG(status)),
                 rank == 0 ? "; run the same command to continue" : "");
    } else if (rank != 0) {
      fmt::print(stderr, "quadruped3d: rank {} of {} ended with exit code {}\n", rank, pids_.size(), code);
    }
    if (deadline_ && are_running()) {
      fmt::print(stderr, "quadruped3d: the other ranks have {} s to finish what they are at\n",
                 kTimeToLeave.count());
    }
  }

  void end_stragglers() {
    if (!deadline_ || Clock::now() < *deadline_) return;
    ::kill(-group_, is_ending_ ? SIGKILL : SIGTERM);
    is_ending_ = true;
    is_stopping_ = true;
    deadline_ = Clock::now() + kTimeToStop;
  }

  char** argv_;
  std::vector<pid_t> pids_;  // by rank; 0 for one that has ended or has not started
  bool are_all_needed_;
  pid_t group_ = 0;  // of the ranks' processes: the id of rank 0's
  ListeningSocket socket_ = listen_on_loopback();
  Pipe ready_ = open_pipe();
  sigset_t signals_before_{};
  int signals_ = hold_signals(signals_before_);
  int code_of_rank_0_ = kFailure;
  bool has_led_ = false;                       // rank 0 has read its config, or ended
  bool is_stopping_ = false;                   // a signal has asked all ranks to end
  bool is_ending_ = false;                     // ranks that outlived their deadline got SIGTERM
  std::optional<Clock::time_point> deadline_;  // for the ranks that still run
};

}  // namespace

WantedRanks wanted_ranks(std::span<char* const> arguments) {
  if (arguments.empty()) return {};
  const auto info = std::find_if(kCommands.begin(), kCommands.end(), [&](const CommandInfo& each) {
    return each.name == std::string_view(arguments.front());
  });
  if (info == kCommands.end() || info->rank_work == RankWork::none) return {};
  const bool asks_for_help = std::any_of(arguments.begin(), arguments.end(), [](std::string_view word) {
    return word == "-h" || word == "--help";
  });
  if (asks_for_help) return {};
  const bool are_all_needed = info->rank_work == RankWork::steps;
  if (const auto text = text_of("--ranks", arguments)) {
    return {number_of_ranks(*text).value_or(1), are_all_needed};
  }
  const std::string_view devices = text_of("--device", arguments).value_or("");
  return {1 + static_cast<int>(std::count(devices.begin(), devices.end(), ',')), are_all_needed};
}

int run_ranks(char** argv, const WantedRanks& ranks) {
  if (const char* variable = other_launcher()) {
    fmt::print(
        stderr,
        "quadruped3d: --ranks {}: the environment variable {} says that a launcher has started this "
        "process as one of several ranks; leave out --ranks, or start the program without the launcher\n",
        ranks.count, variable);
    return kUsage;
  }
  try {
    return LocalRanks(argv, ranks).run();
  } catch (const std::system_error& error) {
    fmt::print(stderr, "quadruped3d: {}\n", error.what());
    return kFailure;
  }
}

}  // namespace q3d::pipeline::cli
