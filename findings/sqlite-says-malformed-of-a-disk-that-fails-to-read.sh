#!/usr/bin/env bash
# SQLite: a disk that fails to read is reported as "database disk image is malformed"
#
# Expected: an error of the disk is an error of the disk. SQLite has SQLITE_IOERR for it, with twenty
#   extended codes; a program that repairs or sets aside what is damaged looks for SQLITE_CORRUPT.
# What happens: where read(2) fails with EIO, a statement raises sqlite3.DatabaseError "database disk image
#   is malformed", sqlite_errorcode 11 (SQLITE_CORRUPT), without an extended code. The file is intact: the
#   next read succeeds, and integrity_check says ok. Any other error number of the same read (EINVAL,
#   EACCES) gives OperationalError "disk I/O error", SQLITE_IOERR_READ, as expected.
# Why: unixRead takes EIO, ENXIO and ERANGE for a corrupt file system (SQLITE_IOERR_CORRUPTFS), and the
#   virtual machine turns that code into SQLITE_CORRUPT on its way out. So the one error number that
#   drives, cables and USB adapters give in passing is the one that looks like lost data.
# Why it matters: who catches OperationalError while writing, by Python's manual that of errors "not
#   necessarily under the control of the programmer", misses it; who repairs damage throws intact data away.
#   Before believing it, read the file.
# With: SQLite 3.40.1 (Debian 12), Python 3.11.
# Output seen:
#   EIO     DatabaseError     11 SQLITE_CORRUPT     database disk image is malformed
#   EINVAL  OperationalError  266 SQLITE_IOERR_READ  disk I/O error
#   afterwards: ok
set -euo pipefail

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cat > "$work/failing.c" <<'C'
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <sys/types.h>
int failing;
ssize_t pread64(int fd, void *data, size_t count, off_t place) {
    static ssize_t (*real)(int, void *, size_t, off_t);
    if (!real) real = (ssize_t (*)(int, void *, size_t, off_t))dlsym(RTLD_NEXT, "pread64");
    if (failing) { errno = failing; return -1; }
    return real(fd, data, count, place);
}
C
cc -shared -fPIC -o "$work/failing.so" "$work/failing.c" -ldl
cat > "$work/show.py" <<'PY'
import ctypes
import errno
import sqlite3
import sys

failing = ctypes.c_int.in_dll(ctypes.CDLL(None), "failing")
with sqlite3.connect(sys.argv[1]) as made:
    made.execute("CREATE TABLE t (n)")
    made.executemany("INSERT INTO t VALUES (?)", [(n,) for n in range(10000)])
for number in (errno.EIO, errno.EINVAL):
    connection = sqlite3.connect(sys.argv[1])
    connection.execute("SELECT 1 FROM t LIMIT 1").fetchall()
    connection.execute("PRAGMA shrink_memory")
    failing.value = number
    try:
        connection.execute("SELECT sum(n) FROM t").fetchall()
    except sqlite3.Error as error:
        print(f"{errno.errorcode[number]:7} {type(error).__name__:17} {error.sqlite_errorcode}",
              f"{error.sqlite_errorname:18} {error}")
    failing.value = 0
print("afterwards:", sqlite3.connect(sys.argv[1]).execute("PRAGMA integrity_check").fetchone()[0])
PY
LD_PRELOAD="$work/failing.so" python3 "$work/show.py" "$work/a.sqlite"
