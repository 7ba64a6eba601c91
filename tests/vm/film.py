"""The simulated camera's pictures of the liner, woven into frames as a video player has them."""

from pathlib import Path

import numpy as np

from grabberd_fake import FakeOptions
from grabberd_fake.faults import PERIOD_NS
from grabberd_fake.world import Truth, World

COLUMNS, ROWS = 720, 288
PERIOD_S = 2.0
"""One pulsation, and the film's length: longer than any old picture can be mistaken for a new one."""
FIELDS = round(PERIOD_S * 1e9 / PERIOD_NS)
OPTIONS = {"scene": "liner", "liner": {"period_s": PERIOD_S}}


def render(path: Path) -> None:
    """Writes the film; field k bears the number k in its stamp, and its end fits its beginning."""
    world = World(FakeOptions.read(OPTIONS))
    woven = np.empty((2 * ROWS, COLUMNS), np.uint8)
    field = np.empty((ROWS, COLUMNS), np.uint8)
    with path.open("wb") as file:
        for number in range(FIELDS):
            world.picture(number, field)
            woven[number % 2 :: 2] = field
            if number % 2:
                file.write(woven.tobytes())


def truth(number: int) -> Truth:
    """What is true at the field of this number."""
    return World(FakeOptions.read(OPTIONS)).truth(number * PERIOD_NS)
