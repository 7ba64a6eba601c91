"""How many damaged fields a look at their content finds, and how many whole ones it takes for damaged."""

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from grabberd.core.field import Field, Packing
from grabberd.instrument.acquisition.content_check import Content, ContentCheck
from grabberd.instrument.acquisition.device import GrabbedField
from grabberd_fake.options import FakeOptions
from grabberd_fake.world import World

Luma = NDArray[np.uint8]

FIELDS = 400
"""Whole fields of each scene."""
EVERY = 8
"""Fields from one that is damaged to the next."""
SHIFTS_PX = (8, 12, 16, 25, 26, 40, 100, 180, 360, 500, 700)
FIRST_ROWS = (60, 144, 200, 240)
STALE_ROWS = (1, 5, 20, 100)
PACKING = Packing(1, doubled=False, threshold=60)
"""What is found does not depend on it."""

SCENES: Mapping[str, tuple[Mapping[str, Any], float]] = {
    "liner, 2 % noise": ({}, 0),
    "liner, 1 % noise": ({"picture": {"noise": 0.01}}, 0),
    "liner, .5 % noise": ({"picture": {"noise": 0.005}}, 0),
    "liner, .5 % noise, black clipped at 1 σ": ({"picture": {"noise": 0.005}}, 1),
    "liner, .5 % noise, black clipped at 3 σ": ({"picture": {"noise": 0.005}}, 3),
    "liner, 5 % noise": ({"picture": {"noise": 0.05}}, 0),
    "liner, two pulsations a second": ({"liner": {"period_s": 0.5}}, 0),
    "calibration frame, 2 % noise": ({"scene": "calibration_frame"}, 0),
    "accuracy object, .5 % noise": ({"scene": "accuracy_object", "picture": {"noise": 0.005}}, 0),
    "blank, 2 % noise": ({"scene": "blank"}, 0),
}
"""Options of the simulated grabber, and by how many σ of noise black is clipped above its level (0: not)."""


def table() -> str:
    """Shares of damaged fields that are found, and false alarms."""
    head = (
        f"Shifts by {_listed(SHIFTS_PX)} px from rows {_listed(FIRST_ROWS)} of a field on; stale: the last "
        f"{_listed(STALE_ROWS)} rows. A shift shows where targets lie above its first row and below: the "
        "accuracy object has next to none above row 60 and none below row 240.\n\n"
        "| scene | shifts found | by the right number, ± 2 px | stale rows found, by their number "
        "| whole fields called damaged |\n|---|---|---|---|---|"
    )
    return "\n".join([head, *(_row(name, *scene) for name, scene in SCENES.items())])


def _listed(numbers: Iterable[int]) -> str:
    return ", ".join(map(str, numbers))


def lost(luma: Luma, row: int, columns: int) -> Luma:
    """`columns` pixels are lost from the stream at the start of `row`; what follows moves up."""
    stream = luma.reshape(-1)
    first = row * luma.shape[1]
    kept = (stream[:first], stream[first + columns :], stream[len(stream) - columns :])
    return np.concatenate(kept).reshape(luma.shape)


def _row(name: str, options: Mapping[str, Any], clip_sigmas: float) -> str:
    lumas = list(_seen(options, clip_sigmas))
    false = sum(content != Content() for content in _looked_at(lumas))
    shifts = [_shifts_found(lumas, columns, row) for columns in SHIFTS_PX for row in FIRST_ROWS]
    found, right, of = np.sum(shifts, axis=0)
    stale = " / ".join(f"{_stale_found(lumas, rows):.0%}" for rows in STALE_ROWS)
    return f"| {name} | {found / of:.0%} | {right / of:.0%} | {stale} | {false} of {len(lumas)} |"


def _seen(options: Mapping[str, Any], clip_sigmas: float) -> Iterator[Luma]:
    read = FakeOptions.read({**options, "picture": {"stamp": False, **options.get("picture", {})}})
    world, picture = World(read), read.picture
    clip = round(picture.background + clip_sigmas * picture.noise * picture.contrast) if clip_sigmas else 0
    for number in range(FIELDS):
        luma = np.empty((288, 720), np.uint8)
        world.picture(number, luma)
        yield np.asarray(cv2.subtract(luma, clip), np.uint8)


def _looked_at(lumas: list[Luma]) -> Iterator[Content]:
    check = ContentCheck()
    for n, luma in enumerate(lumas):
        yield check.take(GrabbedField(Field.intact(luma, n % 2), n * 20_000_000, n, None), PACKING)[0]


def _shifts_found(lumas: list[Luma], columns: int, row: int) -> tuple[int, int, int]:
    """Found, found by the right number of columns, damaged."""
    some = lumas[:80]
    damaged = range(12, len(some), EVERY)
    fields = [lost(luma, row, columns) if n in damaged else luma for n, luma in enumerate(some)]
    contents = list(_looked_at(fields))
    told = [re.match(r"shifted by (-?\d+) px", contents[n].damage or "") for n in damaged]
    off = [(int(one[1]) + columns + 360) % 720 - 360 for one in told if one]
    return len(off), sum(abs(one) <= 2 for one in off), len(damaged)


def _stale_found(lumas: list[Luma], rows: int) -> float:
    some = lumas[:120]
    damaged = range(20, len(some), EVERY)
    fields = [luma.copy() for luma in some]
    for n in damaged:
        fields[n][-rows:] = some[n - 2][-rows:]
    contents = list(_looked_at(fields))
    return float(np.mean([(contents[n].damage or "").startswith("stale from") for n in damaged]))
