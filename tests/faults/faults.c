// A library for LD_PRELOAD that makes chosen calls of a program misbehave. With it a test can meet an I/O
// error, or stop the program at an exact point, without waiting for the right moment.
//
// The environment says what happens:
//   Q3D_FAULT_PATH    text that the file's path contains; without it this library changes nothing
//   Q3D_FAULT_CALL    the kind of call: open (open, openat, fopen), read (read, pread),
//                     stat (stat, lstat, fstatat) or sync (fsync, fdatasync)
//   Q3D_FAULT_SKIP    how many matching calls pass unharmed before the fault begins (default 0)
//   Q3D_FAULT_ACTION  fail: this call and all later ones fail with Q3D_FAULT_ERRNO (default)
//                     stop: the process stops itself (SIGSTOP), once; after SIGCONT the call is made
//                     hang: this call and all later ones never return
//   Q3D_FAULT_ERRNO   EIO (default), ESTALE, EMFILE, ENOMEM or a number
//
// Every fault is announced by a line on stderr, "faults: ACTION at CALL of PATH", so that a test can tell
// that it was reached. A call of alarm() is announced as "faults: alarm after SECONDS s".
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <unistd.h>

static const char* fault_path;
static const char* fault_call;
static const char* fault_action;
static int fault_errno;
static long fault_skip;
static atomic_long calls_seen;
static unsigned (*next_alarm)(unsigned);

static int errno_named(const char* name) {
  static const struct {
    const char* name;
    int value;
  } kErrors[] = {{"EIO", EIO}, {"ESTALE", ESTALE}, {"EMFILE", EMFILE}, {"ENOMEM", ENOMEM}};
  for (size_t i = 0; i < sizeof kErrors / sizeof kErrors[0]; ++i) {
    if (strcmp(name, kErrors[i].name) == 0) return kErrors[i].value;
  }
  const int number = atoi(name);
  if (number > 0) return number;
  fprintf(stderr, "faults: Q3D_FAULT_ERRNO: got %s, expected EIO, ESTALE, EMFILE, ENOMEM or a number\n",
          name);
  abort();
}

static const char* setting(const char* name, const char* otherwise) {
  const char* value = getenv(name);
  return value != NULL ? value : otherwise;
}

__attribute__((constructor)) static void read_settings(void) {
  fault_call = setting("Q3D_FAULT_CALL", "");
  fault_action = setting("Q3D_FAULT_ACTION", "fail");
  fault_skip = atol(setting("Q3D_FAULT_SKIP", "0"));
  fault_errno = errno_named(setting("Q3D_FAULT_ERRNO", "EIO"));
  fault_path = getenv("Q3D_FAULT_PATH");
  next_alarm = (unsigned (*)(unsigned))(uintptr_t)dlsym(RTLD_NEXT, "alarm");
}

static void announce(const char* call, const char* path) {
  char line[4400];
  const int length = snprintf(line, sizeof line, "faults: %s at %s of %.4096s\n", fault_action, call, path);
  const ssize_t written = write(STDERR_FILENO, line, (size_t)length);
  (void)written;
}

// Makes the fault happen if the environment chose this call. Returns whether the call must fail; errno is
// then set.
static int strikes(const char* call, const char* path) {
  if (fault_path == NULL || path == NULL) return 0;
  if (strcmp(call, fault_call) != 0 || strstr(path, fault_path) == NULL) return 0;
  const long before = atomic_fetch_add(&calls_seen, 1);
  if (before < fault_skip) return 0;
  if (strcmp(fault_action, "stop") == 0) {
    if (before > fault_skip) return 0;
    announce(call, path);
    raise(SIGSTOP);
    return 0;
  }
  announce(call, path);
  while (strcmp(fault_action, "hang") == 0) pause();
  errno = fault_errno;
  return 1;
}

static int strikes_descriptor(const char* call, int descriptor) {
  if (fault_path == NULL || strcmp(call, fault_call) != 0) return 0;
  char link[64];
  char path[4096];
  snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
  const ssize_t length = readlink(link, path, sizeof path - 1);
  if (length < 0) return 0;
  path[length] = '\0';
  return strikes(call, path);
}

// The function of the same name in the library that comes next.
#define NEXT(result, name, ...)       \
  static result (*next)(__VA_ARGS__); \
  if (next == NULL) next = (result(*)(__VA_ARGS__))(uintptr_t)dlsym(RTLD_NEXT, #name)

#define DEFINE_OPEN(name)                                                                  \
  int name(const char* path, int flags, ...) {                                             \
    NEXT(int, name, const char*, int, ...);                                                \
    va_list rest;                                                                          \
    va_start(rest, flags);                                                                 \
    const mode_t mode = (flags & (O_CREAT | __O_TMPFILE)) != 0 ? va_arg(rest, mode_t) : 0; \
    va_end(rest);                                                                          \
    return strikes("open", path) ? -1 : next(path, flags, mode);                           \
  }
#define DEFINE_OPENAT(name)                                                                \
  int name(int folder, const char* path, int flags, ...) {                                 \
    NEXT(int, name, int, const char*, int, ...);                                           \
    va_list rest;                                                                          \
    va_start(rest, flags);                                                                 \
    const mode_t mode = (flags & (O_CREAT | __O_TMPFILE)) != 0 ? va_arg(rest, mode_t) : 0; \
    va_end(rest);                                                                          \
    return strikes("open", path) ? -1 : next(folder, path, flags, mode);                   \
  }
#define DEFINE_FOPEN(name)                                           \
  FILE* name(const char* restrict path, const char* restrict mode) { \
    NEXT(FILE*, name, const char* restrict, const char* restrict);   \
    return strikes("open", path) ? NULL : next(path, mode);          \
  }
#define DEFINE_PREAD(name, offset_type)                                                          \
  ssize_t name(int descriptor, void* buffer, size_t size, offset_type offset) {                  \
    NEXT(ssize_t, name, int, void*, size_t, offset_type);                                        \
    return strikes_descriptor("read", descriptor) ? -1 : next(descriptor, buffer, size, offset); \
  }
#define DEFINE_STAT(name, status_type)                                       \
  int name(const char* restrict path, struct status_type* restrict status) { \
    NEXT(int, name, const char* restrict, struct status_type* restrict);     \
    return strikes("stat", path) ? -1 : next(path, status);                  \
  }
#define DEFINE_FSTATAT(name, status_type)                                                           \
  int name(int folder, const char* restrict path, struct status_type* restrict status, int flags) { \
    NEXT(int, name, int, const char* restrict, struct status_type* restrict, int);                  \
    return strikes("stat", path) ? -1 : next(folder, path, status, flags);                          \
  }
#define DEFINE_SYNC(name)                                                  \
  int name(int descriptor) {                                               \
    NEXT(int, name, int);                                                  \
    return strikes_descriptor("sync", descriptor) ? -1 : next(descriptor); \
  }

DEFINE_OPEN(open)
DEFINE_OPEN(open64)
DEFINE_OPENAT(openat)
DEFINE_OPENAT(openat64)
DEFINE_FOPEN(fopen)
DEFINE_FOPEN(fopen64)
DEFINE_PREAD(pread, off_t)
DEFINE_PREAD(pread64, off64_t)
DEFINE_STAT(stat, stat)
DEFINE_STAT(stat64, stat64)
DEFINE_STAT(lstat, stat)
DEFINE_STAT(lstat64, stat64)
DEFINE_FSTATAT(fstatat, stat)
DEFINE_FSTATAT(fstatat64, stat64)
DEFINE_SYNC(fsync)
DEFINE_SYNC(fdatasync)

ssize_t read(int descriptor, void* buffer, size_t size) {
  NEXT(ssize_t, read, int, void*, size_t);
  return strikes_descriptor("read", descriptor) ? -1 : next(descriptor, buffer, size);
}

// The program calls this in a signal handler, where little more than write() is allowed.
unsigned alarm(unsigned seconds) {
  if (fault_path != NULL) {
    char line[] = "faults: alarm after 0000000000 s\n";
    char* digit = line + strlen("faults: alarm after 000000000");
    for (unsigned rest = seconds; rest > 0; rest /= 10) *digit-- = (char)('0' + rest % 10);
    const ssize_t written = write(STDERR_FILENO, line, sizeof line - 1);
    (void)written;
  }
  return next_alarm(seconds);
}
