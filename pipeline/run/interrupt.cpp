#include "pipeline/run/interrupt.h"

#include <unistd.h>

#include <csignal>
#include <cstring>

#include "pipeline/run/errors.h"

namespace q3d::pipeline::run {
namespace {

constexpr unsigned kGraceSeconds = 8;
constexpr int kSignalled = 128;  // a shell's exit code for a process that a signal ended, less the signal
volatile std::sig_atomic_t first_signal = 0;
volatile std::sig_atomic_t is_quiet = 0;

void leave_at_once(int) {
  _exit(interrupt_exit_code());
}

// The handler must be async-signal-safe, so it calls only write, alarm and _exit.
void on_signal(int number) {
  if (first_signal != 0) _exit(interrupt_exit_code());
  first_signal = number;
  alarm(kGraceSeconds);
  if (is_quiet != 0) return;
  const char text[] =
      "\ninterrupted: dropping the open unit (finished units stay; run the same command to go on)\n";
  const ssize_t written = write(STDERR_FILENO, text, std::strlen(text));
  static_cast<void>(written);
}

}  // namespace

void install_interrupt_handlers(bool quiet) {
  is_quiet = quiet ? 1 : 0;
  struct sigaction action {};
  action.sa_handler = on_signal;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  struct sigaction present {};
  sigaction(SIGHUP, nullptr, &present);
  if (present.sa_handler != SIG_IGN) sigaction(SIGHUP, &action, nullptr);
  struct sigaction last {};
  last.sa_handler = leave_at_once;
  sigaction(SIGALRM, &last, nullptr);
  // A file size limit that is reached should fail the write, with a message, and not end the process.
  std::signal(SIGXFSZ, SIG_IGN);
}

bool interrupted() {
  return first_signal != 0;
}

int interrupt_exit_code() {
  return kSignalled + (first_signal != 0 ? first_signal : SIGINT);
}

void throw_if_interrupted() {
  if (interrupted()) throw Interrupted("interrupted");
}

}  // namespace q3d::pipeline::run
