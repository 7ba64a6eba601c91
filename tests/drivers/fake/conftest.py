"""Small rigs and worlds for the simulated grabber's tests."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from grabberd_fake import FakeGrabber, FakeOptions, JumpingClock, World

CLEAN = {"noise": 0.0, "jitter_px": 0.0, "stamp": False}


@pytest.fixture
def world() -> Callable[..., World]:
    """Makes a world of options; `picture` is merged into one without noise, jitter and stamp."""

    def make(picture: dict[str, Any] | None = None, **options: Any) -> World:
        return World(FakeOptions.read({"picture": {**CLEAN, **(picture or {})}, **options}))

    return make


@pytest.fixture
def shot() -> Callable[..., NDArray[np.uint8]]:
    """The luma of one field of a world."""

    def take(world: World, field: int = 0) -> NDArray[np.uint8]:
        luma = np.zeros((288, 720), np.uint8)
        world.picture(field, luma)
        return luma

    return take


@pytest.fixture
def grabber() -> Callable[..., tuple[FakeGrabber, JumpingClock]]:
    """A grabber at real pace on a clock that jumps, opened; the scene is blank unless it is named."""

    def make(start_ns: int = 0, **options: Any) -> tuple[FakeGrabber, JumpingClock]:
        clock = JumpingClock(start_ns)
        made = FakeGrabber(clock=clock, **{"scene": "blank", **options})
        made.open()
        return made, clock

    return make
