// A library for LD_PRELOAD that makes chosen calls of a program misbehave. With it a test can meet an I/O
// error, or stop the program at an exact point, without waiting for the right moment.
//
// The environment says what happens:
//   Q3D_FAULT_PATH    text that the file's path contains, or with which it ends if the text ends in "$"; without it
//                     this library changes nothing
//   Q3D_FAULT_CALL    the kind of call: open (open, openat, fopen), read (read, pread),
//                     stat (stat, lstat, fstatat), sync (fsync, fdatasync, syncfs), write, rename, link (link,
//                     symlink), lock (flock), mkdir, close, or change: any of sync, write, rename and link
//   Q3D_FAULT_SKIP    how many matching calls pass unharmed before the fault begins (default 0)
//   Q3D_FAULT_ACTION  fail: this call and all later ones fail with Q3D_FAULT_ERRNO (default)
//                     stop: the process stops itself (SIGSTOP), once; after SIGCONT the call is made
//                     hang: this call and all later ones never return
//                     kill: the process kills itself (SIGKILL) before the call; of a write, one half is made
//                     count: nothing, but when the process exits, a line says how many calls there were:
//                     "faults: counted NUMBER calls"
//   Q3D_FAULT_ERRNO   a number, or a name such as ESTALE (errno_named lists them); EIO is the default
//   Q3D_FAULT_TIMES   how often `fail` strikes; without it, always
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
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <unistd.h>

static const char* fault_path;
static const char* fault_call;
static const char* fault_action;
static int fault_errno;
static long fault_skip;
static long fault_times;
static atomic_long calls_seen;
static unsigned (*next_alarm)(unsigned);

static int errno_named(const char* name) {
  static const struct {
    const char* name;
    int value;
  } kErrors[] = {{"EIO", EIO},       {"ESTALE", ESTALE}, {"EMFILE", EMFILE}, {"ENOMEM", ENOMEM},
                 {"EROFS", EROFS},   {"EACCES", EACCES}, {"EPERM", EPERM},   {"ENOSPC", ENOSPC},
                 {"EDQUOT", EDQUOT}, {"EXDEV", EXDEV},   {"EMLINK", EMLINK}, {"EINTR", EINTR},
                 {"EAGAIN", EAGAIN}, {"EINVAL", EINVAL}, {"ENOLCK", ENOLCK}, {"ENOTSUP", ENOTSUP}};
  for (size_t i = 0; i < sizeof kErrors / sizeof kErrors[0]; ++i) {
    if (strcmp(name, kErrors[i].name) == 0) return kErrors[i].value;
  }
  const int number = atoi(name);
  if (number > 0) return number;
  fprintf(stderr, "faults: Q3D_FAULT_ERRNO: got %s, expected a name such as EIO or a number\n",
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
  fault_times = atol(setting("Q3D_FAULT_TIMES", "-1"));
  fault_errno = errno_named(setting("Q3D_FAULT_ERRNO", "EIO"));
  fault_path = getenv("Q3D_FAULT_PATH");
  next_alarm = (unsigned (*)(unsigned))(uintptr_t)dlsym(RTLD_NEXT, "alarm");
}

static void announce(const char* call, const char* path) {
  char line[4400];
  const int length = snprintf(line, sizeof line, "faults: %s at %s of %.4096s\n", fault_action, call, path);
  const long written = syscall(SYS_write, STDERR_FILENO, line, (size_t)length);
  (void)written;
}

// The write that this thread is about to make, so that a process can be killed in the middle of it.
static _Thread_local struct {
  int descriptor;
  const void* bytes;
  size_t size;
} open_write;

static void kill_this_process(void) {
  if (open_write.bytes != NULL) {
    const long written = syscall(SYS_write, open_write.descriptor, open_write.bytes, open_write.size / 2);
    (void)written;
  }
  kill(getpid(), SIGKILL);
  for (;;) pause();
}

static int is_chosen_path(const char* path) {
  const size_t wanted = strlen(fault_path);
  if (wanted == 0 || fault_path[wanted - 1] != '$') return strstr(path, fault_path) != NULL;
  const size_t size = strlen(path);
  return size + 1 >= wanted && strncmp(path + size + 1 - wanted, fault_path, wanted - 1) == 0;
}

static int is_chosen(const char* call) {
  if (strcmp(fault_call, call) == 0) return 1;
  return strcmp(fault_call, "change") == 0 && (strcmp(call, "sync") == 0 || strcmp(call, "write") == 0 ||
                                               strcmp(call, "rename") == 0 || strcmp(call, "link") == 0);
}

__attribute__((destructor)) static void tell_count(void) {
  if (fault_path == NULL || strcmp(fault_action, "count") != 0) return;
  char line[64];
  const int length = snprintf(line, sizeof line, "faults: counted %ld calls\n", (long)calls_seen);
  const long written = syscall(SYS_write, STDERR_FILENO, line, (size_t)length);
  (void)written;
}

// Makes the fault happen if the environment chose this call. Returns whether the call must fail; errno is
// then set.
static int strikes(const char* call, const char* path) {
  if (fault_path == NULL || path == NULL) return 0;
  if (!is_chosen(call) || !is_chosen_path(path)) return 0;
  const long before = atomic_fetch_add(&calls_seen, 1);
  if (before < fault_skip || strcmp(fault_action, "count") == 0) return 0;
  if (strcmp(fault_action, "stop") == 0) {
    if (before > fault_skip) return 0;
    announce(call, path);
    raise(SIGSTOP);
    return 0;
  }
  if (fault_times >= 0 && before >= fault_skip + fault_times) return 0;
  announce(call, path);
  if (strcmp(fault_action, "kill") == 0) kill_this_process();
  while (strcmp(fault_action, "hang") == 0) pause();
  errno = fault_errno;
  return 1;
}

static int strikes_descriptor(const char* call, int descriptor) {
  if (fault_path == NULL || !is_chosen(call)) return 0;
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
DEFINE_SYNC(syncfs)

ssize_t write(int descriptor, const void* bytes, size_t size) {
  NEXT(ssize_t, write, int, const void*, size_t);
  open_write.descriptor = descriptor;
  open_write.bytes = bytes;
  open_write.size = size;
  const int fails = strikes_descriptor("write", descriptor);
  open_write.bytes = NULL;
  return fails ? -1 : next(descriptor, bytes, size);
}

int rename(const char* from, const char* to) {
  NEXT(int, rename, const char*, const char*);
  return strikes("rename", to) ? -1 : next(from, to);
}

int link(const char* from, const char* to) {
  NEXT(int, link, const char*, const char*);
  return strikes("link", to) ? -1 : next(from, to);
}

int symlink(const char* target, const char* path) {
  NEXT(int, symlink, const char*, const char*);
  return strikes("link", path) ? -1 : next(target, path);
}

int flock(int descriptor, int operation) {
  NEXT(int, flock, int, int);
  return strikes_descriptor("lock", descriptor) ? -1 : next(descriptor, operation);
}

int mkdir(const char* path, mode_t mode) {
  NEXT(int, mkdir, const char*, mode_t);
  return strikes("mkdir", path) ? -1 : next(path, mode);
}

// A close that fails has closed the descriptor all the same, as Linux does it.
int close(int descriptor) {
  NEXT(int, close, int);
  const int fails = strikes_descriptor("close", descriptor);
  const int code = errno;
  const int result = next(descriptor);
  if (!fails) return result;
  errno = code;
  return -1;
}

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
