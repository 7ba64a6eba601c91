"""The simulated camera's pictures, woven into frames as a video player has them, and the truth of them."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from grabberd.archive.capture.reader import CaptureReader
from grabberd.core.field import unpack
from grabberd_fake import FakeOptions
from grabberd_fake.faults import PERIOD_NS
from grabberd_fake.stamp import Stamp, read_stamp
from grabberd_fake.world import Truth, World

COLUMNS, ROWS = 720, 288
PERIOD_S = 2.0
"""One pulsation, and the film's length: longer than any old picture can be mistaken for a new one."""
FIELDS = round(PERIOD_S * 1e9 / PERIOD_NS)
LINER = {"scene": "liner", "liner": {"period_s": PERIOD_S}}
CALIBRATION_FRAME = {"scene": "calibration_frame"}
"""Before the same camera and mirrors."""


def render(path: Path, options: Mapping[str, object] = LINER) -> None:
    """Writes the film; field k bears the number k in its stamp, and its end fits its beginning."""
    world = World(FakeOptions.read(options))
    woven = np.empty((2 * ROWS, COLUMNS), np.uint8)
    field = np.empty((ROWS, COLUMNS), np.uint8)
    with path.open("wb") as file:
        for number in range(FIELDS):
            world.picture(number, field)
            woven[number % 2 :: 2] = field
            if number % 2:
                file.write(woven.tobytes())


def truth(number: int) -> Truth:
    """What is true at the field of this number of the liner's film."""
    return World(FakeOptions.read(LINER)).truth(number * PERIOD_NS)


def stamps(reader: CaptureReader) -> dict[int, Stamp]:
    """Which field of the film each received field of a capture shows; every picture bears its number."""
    read = {numbered.n: read_stamp(unpack(numbered.packed).luma) for numbered in reader.received()}
    return {n: stamp for n, stamp in read.items() if stamp is not None}


def errors_mm(reader: CaptureReader, stamps: Mapping[int, Stamp]) -> np.ndarray:
    """Distances of all points of a capture of the liner's film from where their targets truly were."""
    errors = []
    for n, points in reader.points():
        true = truth(stamps[n].number)
        place = dict(zip(true.ids.tolist(), true.xyz_mm, strict=True))
        errors += [xyz - place[int(id_)] for id_, xyz in zip(points.target, points.xyz_mm, strict=True)]
    return np.linalg.norm(errors, axis=1)
