"""Memory that a field has freed is kept for the next one.

Unless told otherwise glibc gives large blocks back to the kernel as soon as they are freed, and gets them
anew page by page: of a field of arrays that costs as much as what is done with them.
"""

import ctypes

KEPT_BYTES = 32 << 20
"""So much freed memory the process keeps in each of its arenas."""
ARENAS = 2
"""Threads that take turns in the interpreter need few, and each keeps its own."""
LARGEST_BYTES = 4 << 20
"""Larger blocks are still given back at once."""
AHEAD_BYTES = 1 << 20
"""So much is got at once where more is needed."""
_TRIM_THRESHOLD, _TOP_PAD, _MMAP_THRESHOLD, _ARENA_MAX = -1, -2, -3, -8


def keep_freed_memory() -> bool:
    """For this process, from now on; whether its C library can be told so."""
    try:
        tell = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError):
        return False
    asked = {
        _TRIM_THRESHOLD: KEPT_BYTES,
        _ARENA_MAX: ARENAS,
        _MMAP_THRESHOLD: LARGEST_BYTES,
        _TOP_PAD: AHEAD_BYTES,
    }
    return all(tell(option, value) == 1 for option, value in asked.items())
