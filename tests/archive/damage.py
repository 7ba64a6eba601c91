"""A disk that damages files between their being written and their being read back."""

import pytest

from grabberd.archive.export import dataset
from grabberd.archive.state import calibration_store
from grabberd.files import checked_file

WAYS = {
    "cut": lambda content: content[: len(content) * 2 // 3],
    "emptied": lambda content: b"",
    "other bytes": lambda content: (
        content[: len(content) // 2] + b"\xff\0\xaa" * 20 + content[len(content) // 2 + 60 :]
    ),
}
every_way = pytest.mark.parametrize("spoil", WAYS.values(), ids=WAYS)


def damage(monkeypatch, spoil, name=None):
    """Damage every file before it is read back, or those of this name."""
    check_file = checked_file.check_file

    def spoiled(path, check, called):
        if name in (None, called):
            path.chmod(0o644)
            path.write_bytes(spoil(path.read_bytes()))
        check_file(path, check, called)

    for module in (checked_file, dataset, calibration_store):
        monkeypatch.setattr(module, "check_file", spoiled)
