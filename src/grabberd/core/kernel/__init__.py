"""Compiled kernel: the most time-consuming steps of a field, in C, if the installation has it.

It is built with the wheel if a C compiler and Python's headers are available; without it numpy does the same.
Rooms that can use it check `KERNEL` and need to know nothing else (docs/decisions/measurement.md).
"""

from importlib import import_module
from typing import Any, Protocol, cast

Buffer = Any
"""Anything with contiguous memory: an array, a ctypes structure, bytes; `lines` in any strides."""
LAYOUT = 10
"""Version of functions and structures (module.c); a kernel with another one is left over from an older
build."""
DONE, NO_MEMORY, REFUSED, MORE_ROOM, NO_TABLE, NO_FULLNESS, UNSOUND = range(7)
"""Status codes of a call (kernel.h)."""
ANY_NOISE = -1
"""What `NO_TABLE` names where the tables of all noises are wanted (patterns.h)."""


class Kernel(Protocol):
    """Functions of module.c, which documents the contents of the buffers and checks their lengths."""

    def locate(
        self, bits: Buffer, picture: tuple[int, int, int, int, int, int], settings: Buffer, out: Buffer, /
    ) -> tuple[int, int, float, float, float, float, float]:
        """Locate the blobs of a packed field of 1 bit."""

    def locate_grey(
        self, data: Buffer, picture: tuple[int, ...], settings: Buffer, out: Buffer, /
    ) -> tuple[int, int, float, float]:
        """Locate the blobs of a packed field of more bits."""

    def measure(
        self,
        fields: tuple[Buffer, ...],
        picture: tuple[int, int, int, int, int],
        room: int,
        /,
        *arguments: Buffer,
    ) -> int:
        """Measure packed fields of one kind, as far as there are tables and room."""

    def near(self, world: Buffer, /, *arguments: Buffer | float) -> tuple[int, int, float]:
        """Find targets near their expected positions, with their points."""

    def agree(self, world: Buffer, /, *arguments: Buffer) -> int:
        """Check that targets agree with one another, and compute the positions of all."""

    def hypotheses(self, world: Buffer, /, *arguments: Buffer | float) -> tuple[int, int]:
        """List pairs of blobs that may be a target."""

    def largest(self, world: Buffer, /, *arguments: Buffer | float) -> tuple[int, int]:
        """Find the largest set of hypotheses that agree, and what it says of all targets."""

    def centres(self, neighbours: Buffer, discs: Buffer, places_mm: Buffer, /, *arguments: Buffer) -> None:
        """Move points to the centres of their discs."""

    def precision(self, covariance_mm2: Buffer, precision: Buffer, /) -> object:
        """Invert the covariance of the targets' displacements."""

    def predictor(
        self, covariance_mm2: Buffer, precision: Buffer, noise_mm2: float, /, *arguments: Buffer
    ) -> object:
        """Compute what some targets tell of all of them."""

    def pack(self, lines: Buffer, how: tuple[int, ...], by_pixel: Buffer, out: Buffer, /) -> object:
        """Double, quantise and pack the lines of a field."""

    def take(
        self, lines: Buffer, how: tuple[int, ...], by_pixel: Buffer, out: Buffer, /, *look: Buffer | int
    ) -> tuple[int, int, int]:
        """Copy a field out of its buffer, look at its content, and pack it."""

    def shifted(self, means: Buffer, earlier: Buffer, blocks: int, bins: int, /) -> tuple[int, int]:
        """Find the first block of rows that may be shifted sideways, and by how much."""

    def wall_forces(
        self, values: Buffer, rest: Buffer, shear_mpa: float, resistance: Buffer, units: Buffer, /
    ) -> None:
        """Compute the resistance of a thick wall at points, and the work of unit loads."""

    def wall_stiffness(
        self,
        values: Buffer,
        rest: Buffer,
        shear_mpa: float,
        difference_mpa: float,
        contact_mpa: Buffer,
        stiffness: Buffer,
        /,
    ) -> None:
        """Compute the stiffness of a loaded thick wall at points."""


def load(name: str = "grabberd.core.kernel._kernel") -> Kernel | None:
    """Load the kernel from a module; None if there is none for this computer and this version."""
    try:
        kernel = import_module(name)
    except ImportError:
        return None
    return cast("Kernel", kernel) if getattr(kernel, "LAYOUT", None) == LAYOUT else None


KERNEL = load()
"""None if numpy does the work."""


SLOWER = (
    "there is no compiled kernel: numpy takes fields in at a quarter of its speed, and measures and analyses "
    "them at a tenth; install gcc, libc6-dev and python3-dev, then grabberd again"
)
"""Measured by `make bench` and `make profile`; hatch_build.py says the same when it builds without one."""


def what_is_slower() -> str | None:
    """Say, for people, what the lack of a kernel costs; None if there is one."""
    return None if KERNEL else SLOWER


def in_use() -> str:
    """Describe which implementation is in use, for people."""
    return "compiled kernel" if KERNEL else "numpy, no compiled kernel"
