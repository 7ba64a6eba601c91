"""What a daemon holds when it has nothing to do: open files, threads, and live objects of its own kinds."""

import gc
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tests.proofs.world.world import World

SAMPLES, APART_S = 5, 0.3
"""The least of some samples counts: a client's call holds something for a moment."""


def levels(world: "World") -> Counter[str]:
    """Numbers of what the daemon holds."""
    found = _now(world)
    for _ in range(SAMPLES - 1):
        world.computer.sleep(APART_S)
        found &= _now(world)
    return found


def open_files(folder: Path) -> list[str]:
    """Names of the files below a folder that this process has open."""
    links = (one.readlink() for one in Path("/proc/self/fd").iterdir() if one.is_symlink())
    # A deleted one is a dead daemon's.
    return sorted(f"{one}" for one in links if one.is_relative_to(folder) and "(deleted)" not in one.name)


def _now(world: "World") -> Counter[str]:
    gc.collect()
    kinds = map(type, gc.get_objects())
    found = Counter(
        f"objects {one.__qualname__}" for one in kinds if f"{one.__module__}".startswith("grabberd.")
    )
    found["open files"] = len(open_files(world.computer.disk.folder))
    threads = (one.name for one in world.computer.tasks.values() if one.is_daemons)
    found["threads"] = sum(name != "client's call" for name in threads)
    return found
