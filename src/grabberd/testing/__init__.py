"""Contract suites for those who write drivers, loggers and locators: `pip install 'grabberd[testing]'`.

A test file subclasses a suite and says by a fixture what is tested; the program's own are tested by the same:

    class TestMyGrabber(GrabberContract):
        @pytest.fixture
        def bench(self):
            return GrabberBench(MyGrabber(clock=ManualClock()))

`GrabberContract` and `LoggerContract` take a fixture `bench`, `LocatorContract` a fixture `locator`.
"""

import pytest

pytest.register_assert_rewrite(
    "grabberd.testing.grabber_contract",
    "grabberd.testing.logger_contract",
    "grabberd.testing.locator_contract",
)

from grabberd.testing.grabber_contract import FIELDS, GrabberBench, GrabberContract, ManualClock  # noqa: E402
from grabberd.testing.locator_contract import DrawnDiscs, LocatorContract, draw_discs  # noqa: E402 - after what rewrites asserts
from grabberd.testing.logger_contract import COUNT, LoggerBench, LoggerContract  # noqa: E402

__all__ = [
    "COUNT",
    "FIELDS",
    "DrawnDiscs",
    "GrabberBench",
    "GrabberContract",
    "LocatorContract",
    "LoggerBench",
    "LoggerContract",
    "ManualClock",
    "draw_discs",
]
