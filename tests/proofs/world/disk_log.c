/* Preloaded into a world: logs what is written below one folder, stamps files with simulated time, and refuses
 * writing, synchronising or reading as it is told. `disk.py` is the other side. Single-threaded by design.
 *
 * A record: int32 kind, int64 inode, int64 place, int32 length of data, int32 length of a second text, data.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <unistd.h>

enum { WRITE, TRUNCATE, SYNC, SYNC_FAILED, CREATE, RENAME, UNLINK, LINK, MKDIR, RMDIR, SYNC_NAMES };
enum { REFUSE_WRITE = 1, REFUSE_SYNC = 2, REFUSE_READ = 4, REFUSE_GROWTH = 8 };

#define FDS 65536
static char root[PATH_MAX];
static size_t root_length;
static int64_t inode_of[FDS]; /* 0: not below the root */
static unsigned char is_folder[FDS];
static char *records;
static size_t used, room;
int64_t utc_ns;
static int64_t commits, crash_at = -1;
static int crashed, refuse, refuse_errno, refuse_after, spared;

void disk_end(void) { root_length = 0; used = 0; memset(inode_of, 0, sizeof inode_of); }
void disk_begin(const char *folder) { strcpy(root, folder); root_length = strlen(folder); used = 0; commits = 0; crashed = 0; crash_at = -1; refuse = 0; memset(inode_of, 0, sizeof inode_of); }
const char *disk_records(int64_t *length) { *length = (int64_t)used; return records; }
void disk_forget(void) { used = 0; }
int64_t disk_commits(void) { return commits; }
void disk_crash_at(int64_t commit) { crash_at = commit; }
void disk_crash(void) { crashed = 1; }
int disk_crashed(void) { return crashed; }
void disk_refuse(int what, int number, int after) { refuse = what; refuse_errno = number; refuse_after = after; }
void disk_spare(int on) { spared = on; }

#define NEXT(type, name) static type (*real)(); if (!real) real = (type (*)())dlsym(RTLD_NEXT, name)

static void append(int32_t kind, int64_t inode, int64_t place, const void *data, size_t length, const void *more, size_t further) {
    if (crashed) return;
    size_t size = 28 + length + further;
    if (used + size > room) { room = 2 * (used + size) + 65536; records = realloc(records, room); }
    char *to = records + used;
    int32_t one = (int32_t)length, two = (int32_t)further;
    memcpy(to, &kind, 4); memcpy(to + 4, &inode, 8); memcpy(to + 12, &place, 8); memcpy(to + 20, &one, 4); memcpy(to + 24, &two, 4);
    memcpy(to + 28, data, length);
    if (further) memcpy(to + 28 + length, more, further);
    used += size;
}

/* A point at which a crash leaves something else before than after. */
static void commit_point(void) { if (root_length && !crashed && commits++ == crash_at) crashed = 1; }

static int refused(int what) {
    if (spared || !(refuse & what)) return 0;
    if (refuse_after > 0) { refuse_after--; return 0; }
    errno = refuse_errno;
    return 1;
}

static void stamp(int fd) {
    NEXT(int, "futimens");
    struct timespec times[2] = {{utc_ns / 1000000000, utc_ns % 1000000000}, {utc_ns / 1000000000, utc_ns % 1000000000}};
    real(fd, times);
}

static int below(const char *path) { return root_length && !strncmp(path, root, root_length) && (path[root_length] == '/' || !path[root_length]); }

/* The absolute path, or NULL if it is not below the root. */
static const char *resolved(int folder, const char *path, char *into) {
    if (!root_length || !path) return NULL;
    if (path[0] == '/') return below(path) ? path : NULL;
    char link[64];
    ssize_t length;
    if (folder == AT_FDCWD) { if (!getcwd(into, PATH_MAX)) return NULL; length = (ssize_t)strlen(into); }
    else { snprintf(link, sizeof link, "/proc/self/fd/%d", folder); length = readlink(link, into, PATH_MAX - 1); if (length < 0) return NULL; into[length] = 0; }
    snprintf(into + length, PATH_MAX - (size_t)length, "/%s", path);
    return below(into) ? into : NULL;
}

static int opened(int folder, const char *path, int flags, int mode, int (*open_)(int, const char *, int, ...)) {
    char into[PATH_MAX];
    const char *full = resolved(folder, path, into);
    if (!full) { int fd = open_(folder, path, flags, mode); if (fd >= 0 && fd < FDS) inode_of[fd] = 0; return fd; }
    struct stat found;
    int was = !lstat(full, &found);
    if (!was && (flags & O_CREAT)) { if (refused(REFUSE_GROWTH)) return -1; commit_point(); }
    int fd = open_(folder, path, flags, mode);
    if (fd < 0 || fd >= FDS || fstat(fd, &found)) return fd;
    inode_of[fd] = (int64_t)found.st_ino;
    is_folder[fd] = S_ISDIR(found.st_mode);
    if (!was) { append(CREATE, inode_of[fd], found.st_mode & 07777, full, strlen(full), NULL, 0); stamp(fd); }
    else if (flags & O_TRUNC) { append(TRUNCATE, inode_of[fd], 0, NULL, 0, NULL, 0); stamp(fd); }
    return fd;
}

static int real_openat(int folder, const char *path, int flags, ...) {
    NEXT(int, "openat64");
    va_list more; va_start(more, flags); int mode = va_arg(more, int); va_end(more);
    return real(folder, path, flags, mode);
}

#define MODE int mode = 0; if (flags & (O_CREAT | __O_TMPFILE)) { va_list more; va_start(more, flags); mode = va_arg(more, int); va_end(more); }
int open(const char *path, int flags, ...) { MODE return opened(AT_FDCWD, path, flags, mode, real_openat); }
int open64(const char *path, int flags, ...) { MODE return opened(AT_FDCWD, path, flags, mode, real_openat); }
int openat(int folder, const char *path, int flags, ...) { MODE return opened(folder, path, flags, mode, real_openat); }
int openat64(int folder, const char *path, int flags, ...) { MODE return opened(folder, path, flags, mode, real_openat); }

int close(int fd) { NEXT(int, "close"); if (fd >= 0 && fd < FDS) inode_of[fd] = 0; return real(fd); }

static int64_t tracked(int fd) { return fd >= 0 && fd < FDS ? inode_of[fd] : 0; }

static int cannot_write(int fd, int64_t end) {
    if (refused(REFUSE_WRITE)) return 1;
    struct stat found;
    return (refuse & REFUSE_GROWTH) && !fstat(fd, &found) && end > found.st_size && refused(REFUSE_GROWTH);
}

static ssize_t written(int fd, const void *data, size_t count, off_t place) {
    NEXT(ssize_t, "pwrite64");
    if (cannot_write(fd, place + (int64_t)count)) return -1;
    ssize_t done = real(fd, data, count, place);
    if (done > 0) { append(WRITE, inode_of[fd], place, data, (size_t)done, NULL, 0); stamp(fd); }
    return done;
}

ssize_t pwrite64(int fd, const void *data, size_t count, off_t place) {
    NEXT(ssize_t, "pwrite64");
    return tracked(fd) ? written(fd, data, count, place) : real(fd, data, count, place);
}
ssize_t pwrite(int fd, const void *data, size_t count, off_t place) { return pwrite64(fd, data, count, place); }

ssize_t write(int fd, const void *data, size_t count) {
    NEXT(ssize_t, "write");
    if (!tracked(fd)) return real(fd, data, count);
    off_t place = lseek(fd, 0, (fcntl(fd, F_GETFL) & O_APPEND) ? SEEK_END : SEEK_CUR);
    ssize_t done = written(fd, data, count, place);
    if (done > 0) lseek(fd, place + done, SEEK_SET);
    return done;
}

ssize_t pread64(int fd, void *data, size_t count, off_t place) {
    NEXT(ssize_t, "pread64");
    if (tracked(fd) && refused(REFUSE_READ)) return -1;
    return real(fd, data, count, place);
}
ssize_t pread(int fd, void *data, size_t count, off_t place) { return pread64(fd, data, count, place); }

int ftruncate64(int fd, off_t size) {
    NEXT(int, "ftruncate64");
    if (!tracked(fd)) return real(fd, size);
    if (cannot_write(fd, size)) return -1;
    int failed = real(fd, size);
    if (!failed) { append(TRUNCATE, inode_of[fd], size, NULL, 0, NULL, 0); stamp(fd); }
    return failed;
}
int ftruncate(int fd, off_t size) { return ftruncate64(fd, size); }

int posix_fallocate64(int fd, off_t place, off_t length) {
    NEXT(int, "posix_fallocate64");
    if (!tracked(fd)) return real(fd, place, length);
    struct stat found;
    fstat(fd, &found);
    if (place + length <= found.st_size) return 0;
    return ftruncate64(fd, place + length) ? errno : 0;
}
int posix_fallocate(int fd, off_t place, off_t length) { return posix_fallocate64(fd, place, length); }

static int synced(int fd) {
    if (refused(REFUSE_SYNC)) { append(SYNC_FAILED, inode_of[fd], 0, NULL, 0, NULL, 0); return -1; }
    commit_point();
    append(is_folder[fd] ? SYNC_NAMES : SYNC, inode_of[fd], 0, NULL, 0, NULL, 0);
    return 0;
}
int fsync(int fd) { NEXT(int, "fsync"); return tracked(fd) ? synced(fd) : real(fd); }
int fdatasync(int fd) { NEXT(int, "fdatasync"); return tracked(fd) ? synced(fd) : real(fd); }

static int moved(int from, const char *old, int to, const char *new, int kind) {
    char one[PATH_MAX], two[PATH_MAX];
    const char *before = resolved(from, old, one), *after = resolved(to, new, two);
    static int (*rename_)(int, const char *, int, const char *), (*link_)(int, const char *, int, const char *, int);
    if (!rename_) { rename_ = (int (*)(int, const char *, int, const char *))dlsym(RTLD_NEXT, "renameat"); link_ = (int (*)(int, const char *, int, const char *, int))dlsym(RTLD_NEXT, "linkat"); }
    if (before || after) { if (refused(REFUSE_WRITE)) return -1; commit_point(); }
    int failed = kind == RENAME ? rename_(from, old, to, new) : link_(from, old, to, new, 0);
    if (!failed && before && after) append(kind, 0, 0, before, strlen(before), after, strlen(after));
    return failed;
}
int rename(const char *old, const char *new) { return moved(AT_FDCWD, old, AT_FDCWD, new, RENAME); }
int renameat(int from, const char *old, int to, const char *new) { return moved(from, old, to, new, RENAME); }
int link(const char *old, const char *new) { return moved(AT_FDCWD, old, AT_FDCWD, new, LINK); }
int linkat(int from, const char *old, int to, const char *new, int flags) { (void)flags; return moved(from, old, to, new, LINK); }

int unlinkat(int folder, const char *path, int flags) {
    NEXT(int, "unlinkat");
    char into[PATH_MAX];
    const char *full = resolved(folder, path, into);
    if (full) commit_point();
    int failed = real(folder, path, flags);
    if (!failed && full) append(flags & AT_REMOVEDIR ? RMDIR : UNLINK, 0, 0, full, strlen(full), NULL, 0);
    return failed;
}
int unlink(const char *path) { return unlinkat(AT_FDCWD, path, 0); }
int rmdir(const char *path) { return unlinkat(AT_FDCWD, path, AT_REMOVEDIR); }

int mkdirat(int folder, const char *path, mode_t mode) {
    NEXT(int, "mkdirat");
    char into[PATH_MAX];
    const char *full = resolved(folder, path, into);
    if (full && refused(REFUSE_GROWTH)) return -1;
    int failed = real(folder, path, mode);
    if (!failed && full) append(MKDIR, 0, mode, full, strlen(full), NULL, 0);
    return failed;
}
int mkdir(const char *path, mode_t mode) { return mkdirat(AT_FDCWD, path, mode); }

int utimensat(int folder, const char *path, const struct timespec times[2], int flags) {
    NEXT(int, "utimensat");
    char into[PATH_MAX];
    struct timespec now[2] = {{utc_ns / 1000000000, utc_ns % 1000000000}, {utc_ns / 1000000000, utc_ns % 1000000000}};
    return real(folder, path, !times && resolved(folder, path, into) ? now : times, flags);
}

/* Copied by reading and writing, which is logged. */
ssize_t sendfile64(int out, int in, off_t *place, size_t count) { NEXT(ssize_t, "sendfile64"); if (tracked(out)) { errno = ENOTSOCK; return -1; } return real(out, in, place, count); }
ssize_t sendfile(int out, int in, off_t *place, size_t count) { return sendfile64(out, in, place, count); }
