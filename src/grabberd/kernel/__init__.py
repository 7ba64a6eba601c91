"""The compiled kernel: what takes most of a field's time, in C, where the installation has it.

It is built with the wheel where a C compiler and Python's headers are at hand; without it numpy does the
same. The rooms that have work for it ask for `KERNEL`, and need no other sign of it.
"""

from importlib import import_module
from typing import Any, Protocol, cast

Buffer = Any
"""What shares its contiguous memory: an array, a ctypes structure, bytes."""
LAYOUT = 2
"""Of functions and structures (module.c): a kernel with another one is left over from an older build."""
DONE, NO_MEMORY, REFUSED, MORE_ROOM, NO_TABLE, NO_FULLNESS = range(6)
"""What a call ends with (kernel.h)."""


class Kernel(Protocol):
    """The functions of module.c; what buffers hold is said there, and their lengths are checked there."""

    def locate(
        self,
        bits: Buffer,
        picture: tuple[int, int, int, int, int, int],
        settings: Buffer,
        out: Buffer,
        /,
    ) -> tuple[int, int, float, float, float, float]:
        """Blobs of a packed field of 1 bit."""

    def locate_grey(
        self, data: Buffer, picture: tuple[int, ...], settings: Buffer, out: Buffer, /
    ) -> tuple[int, int, float, float]:
        """Blobs of a packed field of more bits."""

    def whole(self, xy_px: Buffer, /, *arguments: Buffer | float) -> int:
        """Blobs that lie in a view as a whole."""

    def near(self, world: Buffer, /, *arguments: Buffer | float) -> tuple[int, int, float]:
        """Targets near where they must be, and their points."""

    def agree(self, world: Buffer, /, *arguments: Buffer) -> int:
        """Whether targets agree, and where all of them are."""


def load(name: str = "grabberd.kernel._kernel") -> Kernel | None:
    """The kernel as a module of this name; None where it has not been built for this computer and program."""
    try:
        found = import_module(name)
    except ImportError:
        return None
    return cast("Kernel", found) if getattr(found, "LAYOUT", None) == LAYOUT else None


KERNEL = load()
"""None where numpy does the work."""


def in_use() -> str:
    """How the work is done, for people."""
    return "compiled kernel" if KERNEL else "numpy, no compiled kernel"
