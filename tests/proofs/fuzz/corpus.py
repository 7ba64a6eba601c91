"""Files that once were read wrongly: a folder for each target, replayed by every run of the tests."""

import hashlib
import lzma
from collections.abc import Iterator
from pathlib import Path

FOLDER = Path(__file__).with_name("corpus")
LARGEST = 100_000
"""Bytes of a file that is kept, compressed if it is large: captures are full of zeros."""
_PLAIN = 10_000
_COMPRESSED = ".xz"


def keep(target: str, content: bytes) -> Path | None:
    """Keeps a file under a name made of its content; None if it is too large."""
    small = len(content) <= _PLAIN
    stored = content if small else lzma.compress(content)
    if len(stored) > LARGEST:
        return None
    path = FOLDER / target / (hashlib.sha256(content).hexdigest()[:12] + ("" if small else _COMPRESSED))
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(stored)
    return path


def kept() -> Iterator[tuple[str, Path]]:
    """All files, each with the name of its target."""
    return ((path.parent.name, path) for path in sorted(FOLDER.glob("*/*")))


def content_of(path: Path) -> bytes:
    """The file as it was read."""
    stored = path.read_bytes()
    return lzma.decompress(stored) if path.suffix == _COMPRESSED else stored
