"""Contents for a process to read; it imports this file alone, and none of a test's own needs."""

import os
import resource
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from grabberd.errors import ReadingGivenUp
from grabberd.files.reading import check_patience


def echo(word: str) -> bytes:
    return word.encode()


def about() -> bytes:
    """Number, niceness, limit of memory and rank for being killed of the process."""
    rank = Path("/proc/self/oom_score_adj").read_text().strip()
    return f"{os.getpid()} {os.nice(0)} {resource.getrlimit(resource.RLIMIT_DATA)[0]} {rank}".encode()


def crash() -> bytes:
    os.abort()


def endless(file: Path) -> bytes:
    with file.open("ab") as begun:
        begun.write(b".")
    while True:
        check_patience("nothing")
        time.sleep(0.001)


def deaf(file: Path) -> bytes:
    """Does not notice that nobody waits."""
    file.touch()
    time.sleep(600)
    return b""


def chatty() -> bytes:
    print("a library says something")
    return b"and this is the answer"


def counting(file: Path) -> Iterator[str]:
    try:
        for number in range(100):
            yield f"{number}" * 70_000
    finally:
        file.touch()


def breaking() -> Iterator[bytes]:
    yield bytes(100_000)
    raise ReadingGivenUp("it broke", "try again")


def read(name: str, *arguments: Any) -> Any:
    """What the process answers."""
    reads = (echo, about, crash, endless, deaf, chatty, counting, breaking)
    return {one.__name__: one for one in reads}[name](*arguments)
