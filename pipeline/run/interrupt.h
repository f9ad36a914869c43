// Handles Ctrl-C, SIGTERM and SIGHUP: the program takes no new work, drops the open unit and ends within ten
// seconds.
#pragma once

namespace q3d::pipeline::run {

// Installs the handlers and a watchdog. The first signal sets the flag. If the program has not ended eight
// seconds later, or at a second signal, the process exits at once. That is safe at any moment, because
// nothing on disk counts before its journal line. SIGHUP stays ignored if it was (nohup). A `quiet` process
// does not say on stderr that it was interrupted.
void install_interrupt_handlers(bool quiet = false);

bool interrupted();
void throw_if_interrupted();  // throws Interrupted

// Returns the exit code for the first signal, as shells do: 130 for SIGINT, 143 for SIGTERM and 129 for
// SIGHUP. It is 130 if there was none.
int interrupt_exit_code();

}  // namespace q3d::pipeline::run
