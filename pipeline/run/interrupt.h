// Ctrl-C, SIGTERM and SIGHUP: stop taking new work, drop the open unit, leave within ten seconds.
#pragma once

namespace q3d::pipeline::run {

// Installs the handlers and a watchdog: the first signal sets the flag; if the program has not ended by
// itself eight seconds later, or at a second signal, the process exits at once. That is safe at any moment,
// because nothing on disk counts before its journal line. SIGHUP stays ignored if it was (nohup).
void install_interrupt_handlers();

bool interrupted();
void throw_if_interrupted();  // throws Interrupted

// The exit code after the signal that came first, as shells give it: 130 for SIGINT, 143 for SIGTERM and 129
// for SIGHUP. 130 if there was none.
int interrupt_exit_code();

}  // namespace q3d::pipeline::run
