// Ctrl-C and SIGTERM: stop taking new work, drop the open unit, leave within ten seconds.
#pragma once

namespace q3d::pipeline::run {

// Installs the handlers and a watchdog: the first signal sets the flag; if the program has not ended by
// itself eight seconds later, or at a second signal, the process exits with 130 at once. That is safe at any
// moment, because nothing on disk counts before its journal line.
void install_interrupt_handlers();

bool interrupted();
void throw_if_interrupted();  // throws Interrupted

}  // namespace q3d::pipeline::run
