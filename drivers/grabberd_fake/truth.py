"""What is true at a time: of options, or of every field of a capture file."""

import json
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing
from functools import lru_cache
from pathlib import Path
from typing import Any

from grabberd.errors import CaptureFileError
from grabberd_fake.options import FakeOptions
from grabberd_fake.world import Truth, World

CSV_HEADER = "n,time_ns,target,x_mm,y_mm,z_mm,visible"


def truth_at(options: FakeOptions | Mapping[str, Any], time_ns: int) -> Truth:
    """What is true of the targets at a time.

    Args:
        options: as `FakeGrabber` takes them.
        time_ns: a field's time, or any other on the same clock.

    Raises:
        ValueError: the options cannot be used.
    """
    return _world(options if isinstance(options, FakeOptions) else FakeOptions.read(options)).truth(time_ns)


@lru_cache(maxsize=4)
def _world(options: FakeOptions) -> World:
    return World(options)


def capture_truth(path: Path) -> Iterator[str]:
    """CSV lines, the header first: every target's place at every field of a capture.

    The column `visible` is 1 where both views can see it.

    Raises:
        CaptureFileError: it is no capture, or one that another driver made.
    """
    options, fields = _read_capture(path)
    yield CSV_HEADER
    world = World(options)
    for n, time_ns in fields:
        truth = world.truth(time_ns)
        visible = (truth.visible_left & truth.visible_right).astype(int).tolist()
        for target, (x, y, z), seen in zip(truth.ids.tolist(), truth.xyz_mm.tolist(), visible, strict=True):
            yield f"{n},{time_ns},{target},{x:.6f},{y:.6f},{z:.6f},{seen}"


def _read_capture(path: Path) -> tuple[FakeOptions, list[tuple[int, int]]]:
    try:
        with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)) as database:
            row = database.execute("SELECT value FROM meta WHERE key = 'device'").fetchone()
            fields = database.execute(
                "SELECT n, time_ns FROM fields WHERE time_ns IS NOT NULL ORDER BY n"
            ).fetchall()
    except sqlite3.Error as error:
        raise CaptureFileError(f"{path}: not a capture file: {error}", "name a sealed .grab file") from error
    return _options_of(path, json.loads(row[0]) if row else {}), fields


def _options_of(path: Path, device: Mapping[str, Any]) -> FakeOptions:
    if device.get("driver") != "fake":
        raise CaptureFileError(
            f"{path}: made with driver {device.get('driver')!r}, not 'fake'",
            "only a simulated scene's truth is known",
        )
    return FakeOptions.read(device.get("options") or {})
