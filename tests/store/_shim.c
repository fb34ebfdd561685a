/* Fails, or kills its process, at the n-th change of a file below a directory. Loaded before libc (LD_PRELOAD).

   arm(root, n, kind): kind 1 is ENOSPC, 2 is EIO, 3 is SIGKILL before the call, 4 is SIGKILL after half of it (of a
   write) or after it (of anything else). fired() says whether that has happened, counted() how many there were.
   Failures last: what follows the n-th fails as well, as on a disk that is full or broken; but files can be removed. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>

static char root[PATH_MAX];
static int kind, at, count, has_fired;
static char ours[65536];

void arm(const char *below, int n, int how) { strncpy(root, below, PATH_MAX - 1); at = n; kind = how; count = has_fired = 0; }
int fired(void) { return has_fired; }
int counted(void) { return count; }

#define REAL(type, name, ...) static type (*real)(__VA_ARGS__); if (!real) real = dlsym(RTLD_NEXT, #name)

static int inside(const char *path) { return kind && path && !strncmp(path, root, strlen(root)); }
static void killed(void) { kill(getpid(), SIGKILL); for (;;) pause(); }

/* 1: the call is to fail; 2: it is to be the last one */
static int due(void) {
  if (!kind) return 0;
  count++;
  if (count < at) return 0;
  has_fired = 1;
  if (kind == 3) killed();
  if (kind == 4) return count == at ? 2 : 0;
  errno = kind == 1 ? ENOSPC : EIO;
  return 1;
}

#define OPEN(name) int name(const char *path, int flags, ...) { \
  REAL(int, name, const char *, int, ...); \
  va_list rest; va_start(rest, flags); mode_t mode = va_arg(rest, mode_t); va_end(rest); \
  int is = inside(path), what = is && (flags & O_CREAT) && access(path, F_OK) ? due() : 0; \
  if (what == 1) return -1; \
  int fd = real(path, flags, mode); \
  if (what == 2) killed(); \
  if (fd >= 0 && fd < (int)sizeof ours) ours[fd] = is; \
  return fd; }
OPEN(open)
OPEN(open64)

int close(int fd) { REAL(int, close, int); if (fd >= 0 && fd < (int)sizeof ours) ours[fd] = 0; return real(fd); }

#define MINE(fd) (kind && fd >= 0 && fd < (int)sizeof ours && ours[fd])

ssize_t write(int fd, const void *data, size_t size) {
  REAL(ssize_t, write, int, const void *, size_t);
  int what = MINE(fd) ? due() : 0;
  if (what == 1) return -1;
  if (what == 2) { real(fd, data, size / 2); killed(); }
  return real(fd, data, size); }

#define PWRITE(name) ssize_t name(int fd, const void *data, size_t size, off_t place) { \
  REAL(ssize_t, name, int, const void *, size_t, off_t); \
  int what = MINE(fd) ? due() : 0; \
  if (what == 1) return -1; \
  if (what == 2) { real(fd, data, size / 2, place); killed(); } \
  return real(fd, data, size, place); }
PWRITE(pwrite)
PWRITE(pwrite64)

#define ON_FILE(name) int name(int fd) { \
  REAL(int, name, int); int what = MINE(fd) ? due() : 0; if (what == 1) return -1; \
  int done = real(fd); if (what == 2) killed(); return done; }
ON_FILE(fsync)
ON_FILE(fdatasync)

#define TRUNCATE(name) int name(int fd, off_t size) { \
  REAL(int, name, int, off_t); int what = MINE(fd) ? due() : 0; if (what == 1) return -1; \
  int done = real(fd, size); if (what == 2) killed(); return done; }
TRUNCATE(ftruncate)
TRUNCATE(ftruncate64)

int rename(const char *from, const char *to) {
  REAL(int, rename, const char *, const char *); int what = inside(to) ? due() : 0; if (what == 1) return -1;
  int done = real(from, to); if (what == 2) killed(); return done; }

int mkdir(const char *path, mode_t mode) {
  REAL(int, mkdir, const char *, mode_t); int what = inside(path) ? due() : 0; if (what == 1) return -1;
  int done = real(path, mode); if (what == 2) killed(); return done; }

/* removing always works; but a kill may come here too */
int unlink(const char *path) {
  REAL(int, unlink, const char *); int what = kind >= 3 && inside(path) ? due() : 0;
  int done = real(path); if (what == 2) killed(); return done; }
