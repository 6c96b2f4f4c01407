/* Loaded into a process (LD_PRELOAD): counts its calls of the system by kind, and lets the N-th of a kind fail, be short, or be its last.
 *
 * Nothing is counted before `failing_calls_arm`. What is counted stands in a page that processes share, those that are forked later
 * too, and that outlives them: `tests/whole/failing_calls.py` reads it. A thread that has called `failing_calls_spare` is not counted.
 *
 * Allocations are those of our own C and C++, told by the library that asks, and any of 64 KiB and more: Python reports each of its
 * own that fails in one way, and a library of others that ends the process at the thirtieth small one is not ours to mend.
 *
 * Source: dlsym(3), dl_iterate_phdr(3); __libc_malloc and its like are glibc's own names of what is replaced here.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <link.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/uio.h>
#include <unistd.h>

enum kind { OPEN, READ, WRITE, FSYNC, RENAME, MALLOC, SOCKET, KINDS };
enum outcome { COUNT, FAIL, SHORTEN, END };
enum { LARGE_BYTES = 64 << 10, MOST_OWN = 64 };

struct page {
    atomic_long counts[KINDS];
    /* Of the call that was failed: its name, and its file or descriptor; of an allocation, whose it was. */
    char failed[256];
};

static struct page *page;
static enum kind failing;
static long nth;
static enum outcome outcome;
static __thread int is_spared;

static struct {
    uintptr_t from, to;
} own[MOST_OWN];
static int owns;

void *__libc_malloc(size_t size);
void *__libc_calloc(size_t count, size_t size);
void *__libc_realloc(void *old, size_t size);

/* Where our own libraries lie; called again after each library that is loaded. */
static int note_own(struct dl_phdr_info *info, size_t size, void *data) {
    (void)size, (void)data;
    const char *name = strrchr(info->dlpi_name, '/');
    if (name == NULL || !(strstr(info->dlpi_name, "/robot_bench/_") || strstr(info->dlpi_name, "/bluepill_sim/_"))) return 0;
    for (int i = 0; i < info->dlpi_phnum; i++) {
        if (info->dlpi_phdr[i].p_type != PT_LOAD || owns == MOST_OWN) continue;
        own[owns].from = info->dlpi_addr + info->dlpi_phdr[i].p_vaddr;
        own[owns].to = own[owns].from + info->dlpi_phdr[i].p_memsz;
        owns++;
    }
    return 0;
}

static int is_own(void *caller) {
    for (int i = 0; i < owns; i++)
        if ((uintptr_t)caller >= own[i].from && (uintptr_t)caller < own[i].to) return 1;
    return 0;
}

/* Counts from now on. `path` names a file of a page; the others say what becomes of which call, counted from 1. */
int failing_calls_arm(const char *path, int kind, long number, int what) {
    int file = open(path, O_RDWR | O_CLOEXEC);
    void *found = file < 0 ? MAP_FAILED : mmap(NULL, sizeof *page, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    if (file >= 0) close(file);
    if (found == MAP_FAILED) return -1;
    owns = 0;
    dl_iterate_phdr(note_own, NULL);
    failing = (enum kind)kind, nth = number, outcome = (enum outcome)what;
    page = found;
    return 0;
}

void failing_calls_spare(void) { is_spared = 1; }

/* Returns what becomes of a call of this kind; COUNT: nothing. */
static enum outcome counted(enum kind kind, const char *name, const char *file, int descriptor) {
    if (page == NULL || is_spared) return COUNT;
    long number = atomic_fetch_add(&page->counts[kind], 1) + 1;
    if (outcome == COUNT || kind != failing || number != nth) return COUNT;
    if (file != NULL) snprintf(page->failed, sizeof page->failed, "%s %s", name, file);
    else snprintf(page->failed, sizeof page->failed, "%s %d", name, descriptor);
    return outcome;
}

static _Noreturn void end(void) {
    kill(getpid(), SIGKILL);
    for (;;) pause();
}

#define REAL(name) \
    static __typeof__(name) *real; \
    if (real == NULL) *(void **)&real = dlsym(RTLD_NEXT, #name)

/* A call that is made or fails. */
#define WHOLE(kind, result, name, parameters, arguments, file, descriptor, error) \
    result name parameters { \
        REAL(name); \
        switch (counted(kind, #name, file, descriptor)) { \
        case FAIL: errno = error; return -1; \
        case END: end(); \
        default: return real arguments; \
        } \
    }

/* One that moves `size` bytes: short, it moves some of them; the last one of a process that writes, likewise. */
#define MOVING(kind, name, parameters, arguments, descriptor, size, some, error) \
    ssize_t name parameters { \
        REAL(name); \
        switch (counted(kind, #name, NULL, descriptor)) { \
        case FAIL: errno = error; return -1; \
        case END: \
            if (kind == WRITE) { size = some; if (real arguments < 0) end(); } \
            end(); \
        case SHORTEN: if (size > 1) size = some; /* fall through */ \
        default: return real arguments; \
        } \
    }

#define OPENING(name, parameters, arguments, path) \
    int name parameters { \
        REAL(name); \
        mode_t mode = 0; \
        if (flags & (O_CREAT | __O_TMPFILE)) { \
            va_list rest; \
            va_start(rest, flags); \
            mode = va_arg(rest, mode_t); \
            va_end(rest); \
        } \
        switch (counted(OPEN, #name, path, 0)) { \
        case FAIL: errno = EMFILE; return -1; \
        case END: end(); \
        default: return real arguments; \
        } \
    }

OPENING(open, (const char *path, int flags, ...), (path, flags, mode), path)
OPENING(open64, (const char *path, int flags, ...), (path, flags, mode), path)
OPENING(openat, (int folder, const char *path, int flags, ...), (folder, path, flags, mode), path)
OPENING(openat64, (int folder, const char *path, int flags, ...), (folder, path, flags, mode), path)

static FILE *opened(FILE *(*real)(const char *, const char *), const char *name, const char *path, const char *mode) {
    switch (counted(OPEN, name, path, 0)) {
    case FAIL: errno = EMFILE; return NULL;
    case END: end();
    default: return real(path, mode);
    }
}
FILE *fopen(const char *path, const char *mode) { REAL(fopen); return opened(real, "fopen", path, mode); }
FILE *fopen64(const char *path, const char *mode) { REAL(fopen64); return opened(real, "fopen64", path, mode); }

MOVING(READ, read, (int file, void *to, size_t size), (file, to, size), file, size, 1, EIO)
MOVING(READ, pread, (int file, void *to, size_t size, off_t at), (file, to, size, at), file, size, 1, EIO)
MOVING(READ, pread64, (int file, void *to, size_t size, off64_t at), (file, to, size, at), file, size, 1, EIO)
MOVING(WRITE, write, (int file, const void *data, size_t size), (file, data, size), file, size, size / 2, ENOSPC)
MOVING(WRITE, pwrite, (int file, const void *data, size_t size, off_t at), (file, data, size, at), file, size, size / 2, ENOSPC)
MOVING(WRITE, pwrite64, (int file, const void *data, size_t size, off64_t at), (file, data, size, at), file, size, size / 2, ENOSPC)
MOVING(WRITE, writev, (int file, const struct iovec *data, int size), (file, data, size), file, size, size / 2, ENOSPC)
MOVING(WRITE, sendfile64, (int to, int from, off64_t *at, size_t size), (to, from, at, size), to, size, size / 2, ENOSPC)
MOVING(WRITE, copy_file_range, (int from, off64_t *at, int to, off64_t *place, size_t size, unsigned flags),
       (from, at, to, place, size, flags), to, size, size / 2, ENOSPC)

WHOLE(FSYNC, int, fsync, (int file), (file), NULL, file, EIO)
WHOLE(FSYNC, int, fdatasync, (int file), (file), NULL, file, EIO)
WHOLE(RENAME, int, rename, (const char *from, const char *to), (from, to), to, 0, EACCES)
WHOLE(RENAME, int, renameat, (int a, const char *from, int b, const char *to), (a, from, b, to), to, 0, EACCES)

WHOLE(SOCKET, int, socket, (int family, int type, int protocol), (family, type, protocol), NULL, type, EMFILE)
WHOLE(SOCKET, int, socketpair, (int family, int type, int protocol, int pair[2]), (family, type, protocol, pair), NULL, type, EMFILE)
WHOLE(SOCKET, int, bind, (int file, const struct sockaddr *at, socklen_t size), (file, at, size), NULL, file, EADDRINUSE)
WHOLE(SOCKET, int, listen, (int file, int backlog), (file, backlog), NULL, file, EADDRINUSE)
WHOLE(SOCKET, int, connect, (int file, const struct sockaddr *at, socklen_t size), (file, at, size), NULL, file, ECONNREFUSED)
WHOLE(SOCKET, int, accept, (int file, struct sockaddr *from, socklen_t *size), (file, from, size), NULL, file, EMFILE)
WHOLE(SOCKET, int, accept4, (int file, struct sockaddr *from, socklen_t *size, int flags), (file, from, size, flags), NULL, file, EMFILE)
WHOLE(SOCKET, int, getsockname, (int file, struct sockaddr *at, socklen_t *size), (file, at, size), NULL, file, ENOBUFS)
WHOLE(SOCKET, int, setsockopt, (int file, int level, int name, const void *value, socklen_t size), (file, level, name, value, size), NULL, file, ENOBUFS)
WHOLE(SOCKET, int, shutdown, (int file, int how), (file, how), NULL, file, ENOTCONN)
MOVING(SOCKET, send, (int file, const void *data, size_t size, int flags), (file, data, size, flags), file, size, size / 2, ENOBUFS)
MOVING(SOCKET, sendto, (int file, const void *data, size_t size, int flags, const struct sockaddr *at, socklen_t length),
       (file, data, size, flags, at, length), file, size, size / 2, ENOBUFS)
MOVING(SOCKET, recv, (int file, void *to, size_t size, int flags), (file, to, size, flags), file, size, 1, ETIMEDOUT)
MOVING(SOCKET, recvfrom, (int file, void *to, size_t size, int flags, struct sockaddr *at, socklen_t *length),
       (file, to, size, flags, at, length), file, size, 1, ETIMEDOUT)
WHOLE(SOCKET, ssize_t, sendmsg, (int file, const struct msghdr *message, int flags), (file, message, flags), NULL, file, ENOBUFS)
WHOLE(SOCKET, ssize_t, recvmsg, (int file, struct msghdr *message, int flags), (file, message, flags), NULL, file, ETIMEDOUT)

static int is_refused(const char *name, void *caller, size_t size) {
    if (page == NULL || (size < LARGE_BYTES && !is_own(caller))) return 0;
    Dl_info from = {0};
    if (failing == MALLOC && atomic_load(&page->counts[MALLOC]) + 1 == nth) dladdr(caller, &from);
    switch (counted(MALLOC, name, from.dli_fname != NULL ? from.dli_fname : "", 0)) {
    case FAIL: errno = ENOMEM; return 1;
    case END: end();
    default: return 0;
    }
}

void *malloc(size_t size) { return is_refused("malloc", __builtin_return_address(0), size) ? NULL : __libc_malloc(size); }
void *calloc(size_t count, size_t size) {
    return is_refused("calloc", __builtin_return_address(0), count * size) ? NULL : __libc_calloc(count, size);
}
void *realloc(void *old, size_t size) {
    return is_refused("realloc", __builtin_return_address(0), size) ? NULL : __libc_realloc(old, size);
}
/* `new (std::nothrow)`, which is the only one of our C++. */
void *_ZnwmRKSt9nothrow_t(size_t size, const void *tag) {
    (void)tag;
    return is_refused("new", __builtin_return_address(0), size) ? NULL : __libc_malloc(size);
}

void *dlopen(const char *path, int flags) {
    REAL(dlopen);
    void *library = real(path, flags);
    if (page != NULL && library != NULL) {
        owns = 0;
        dl_iterate_phdr(note_own, NULL);
    }
    return library;
}
