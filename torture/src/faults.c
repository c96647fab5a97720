// Preloaded into a command, by the dynamic linker: at its n-th operation on files below a folder, ends it or fails. What
// Rust's standard library asks of the system goes through these functions of libc, so that the program under test is the
// one that users run.
//
// FAULTS_BELOW  the folder
// FAULTS_HOW    KILL: the process dies before the operation, or in the middle of a write; counts what changes the folder
//               ENOSPC: it fails, and all after it, as on a full disk; counts what needs space
//               EIO: it fails, and no other; counts everything
// FAULTS_AT     n, from 1; 0: none
// FAULTS_LOG    file that gets a line per operation counted
#define _GNU_SOURCE
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

enum kind { READS, CHANGES, GROWS };

static char below[PATH_MAX];
static enum kind counts_from = CHANGES;
static int error, is_lasting, log_file = -1;
static long at;
static atomic_long counted;

__attribute__((constructor)) static void start(void) {
    const char *folder = getenv("FAULTS_BELOW"), *how = getenv("FAULTS_HOW"), *n = getenv("FAULTS_AT"),
               *log = getenv("FAULTS_LOG");
    if (!folder || !how || !n || !log) return;
    snprintf(below, sizeof below, "%s", folder);
    at = atol(n);
    if (!strcmp(how, "EIO")) {
        counts_from = READS;
        error = EIO;
    } else if (!strcmp(how, "ENOSPC")) {
        counts_from = GROWS;
        error = ENOSPC;
        is_lasting = 1;
    }
    log_file = syscall(SYS_openat, AT_FDCWD, log, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
}

// Counts an operation; whether it is the one to be struck.
static int is_struck(enum kind kind, const char *name, const char *path) {
    size_t length = strlen(below);
    if (!length || kind < counts_from || strncmp(path, below, length) || (path[length] && path[length] != '/')) return 0;
    long n = atomic_fetch_add(&counted, 1) + 1;
    char line[PATH_MAX + 64];
    int size = snprintf(line, sizeof line, "%s %s\n", name, path[length] ? path + length + 1 : "(the folder)");
    syscall(SYS_write, log_file, line, size);
    return at && (n == at || (n > at && is_lasting));
}

static int strike(void) {
    if (!error) {
        kill(getpid(), SIGKILL);
        for (;;) pause();
    }
    errno = error;
    return -1;
}

static const char *path_of(int file, char *path) {
    char link[64];
    snprintf(link, sizeof link, "/proc/self/fd/%d", file);
    ssize_t size = readlink(link, path, PATH_MAX - 1);
    path[size < 0 ? 0 : size] = 0;
    return path;
}

static const char *path_in(int folder, const char *name, char *path) {
    if (folder == AT_FDCWD || name[0] == '/') return name;
    size_t length = strlen(path_of(folder, path));
    snprintf(path + length, PATH_MAX - length, "%s%s", *name ? "/" : "", name);
    return path;
}

#define REAL(name) __typeof__(name) *real = (__typeof__(name) *)dlsym(RTLD_NEXT, #name)

#define OF_PATH(kind, name, parameters, arguments)                             \
    int name parameters {                                                      \
        REAL(name);                                                            \
        return is_struck(kind, #name, path) ? strike() : real arguments;       \
    }

#define OF_FILE(kind, name, parameters, arguments)                             \
    int name parameters {                                                      \
        REAL(name);                                                            \
        char path[PATH_MAX];                                                   \
        return is_struck(kind, #name, path_of(file, path)) ? strike() : real arguments; \
    }

OF_PATH(GROWS, mkdir, (const char *path, mode_t mode), (path, mode))
OF_PATH(GROWS, rename, (const char *path, const char *to), (path, to))
OF_PATH(CHANGES, rmdir, (const char *path), (path))
OF_PATH(CHANGES, unlink, (const char *path), (path))
OF_FILE(GROWS, ftruncate64, (int file, off64_t size), (file, size))
OF_FILE(GROWS, fdatasync, (int file), (file))
OF_FILE(GROWS, fsync, (int file), (file))
OF_FILE(READS, flock, (int file, int how), (file, how))

int unlinkat(int folder, const char *name, int flags) {
    REAL(unlinkat);
    char path[PATH_MAX];
    return is_struck(CHANGES, "unlink", path_in(folder, name, path)) ? strike() : real(folder, name, flags);
}

ssize_t write(int file, const void *bytes, size_t size) {
    REAL(write);
    char path[PATH_MAX];
    if (!is_struck(GROWS, "write", path_of(file, path))) return real(file, bytes, size);
    real(file, bytes, size / 2);
    return strike();
}

int open64(const char *path, int flags, ...) {
    REAL(open64);
    va_list rest;
    va_start(rest, flags);
    mode_t mode = flags & O_CREAT ? va_arg(rest, mode_t) : 0;
    va_end(rest);
    int is_new = (flags & O_CREAT) != 0;
    return is_struck(is_new ? GROWS : READS, is_new ? "create" : "open", path) ? strike() : real(path, flags, mode);
}

int openat64(int folder, const char *name, int flags, ...) {
    REAL(openat64);
    char path[PATH_MAX];
    return is_struck(READS, "open", path_in(folder, name, path)) ? strike() : real(folder, name, flags);
}

off64_t lseek64(int file, off64_t offset, int from) {
    REAL(lseek64);
    char path[PATH_MAX];
    return is_struck(READS, "seek", path_of(file, path)) ? strike() : real(file, offset, from);
}

char *realpath(const char *path, char *place) {
    REAL(realpath);
    if (!is_struck(READS, "resolve", path)) return real(path, place);
    strike();
    return NULL;
}

struct dirent64 *readdir64(DIR *folder) {
    REAL(readdir64);
    char path[PATH_MAX];
    if (!is_struck(READS, "next in", path_of(dirfd(folder), path))) return real(folder);
    strike();
    return NULL;
}

DIR *opendir(const char *path) {
    REAL(opendir);
    if (!is_struck(READS, "list", path)) return real(path);
    strike();
    return NULL;
}

int statx(int folder, const char *restrict name, int flags, unsigned mask, struct statx *restrict about) {
    REAL(statx);
    char path[PATH_MAX];
    return is_struck(READS, "stat", path_in(folder, name, path)) ? strike() : real(folder, name, flags, mask, about);
}

ssize_t read(int file, void *bytes, size_t size) {
    REAL(read);
    char path[PATH_MAX];
    return is_struck(READS, "read", path_of(file, path)) ? strike() : real(file, bytes, size);
}
