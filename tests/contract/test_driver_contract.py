"""Every driver of a grabber keeps what `grabberd.testing` asks of one."""

from pathlib import Path

import pytest

from contract.drivers import ALL, bench_of
from grabberd.testing import GrabberBench, GrabberContract


class TestEveryGrabber(GrabberContract):
    @pytest.fixture(params=ALL)
    def bench(self, request: pytest.FixtureRequest, tmp_path: Path) -> GrabberBench:
        return bench_of(request.param, tmp_path)
