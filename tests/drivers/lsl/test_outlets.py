"""When a stream of points is announced anew, and that no inlet holds it up."""

import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from running import PATIENCE_S

from drivers.lsl.test_points_layout import LAYOUT, field
from grabberd.client.points_stream import StreamedPoints
from grabberd.documents.points_frame import PointsDescription
from grabberd.errors import ExtraMissing
from grabberd_lsl import outlets
from grabberd_lsl.outlets import LslClock, Outlets, PointsLayout

INLET, PUSHING = (Path(__file__).with_name(name) for name in ("inlet.py", "pushing.py"))
OTHER = PointsLayout("other", ((7, 0, 0), (8, 0, 1)))


class FakeLsl:
    """Keeps what is announced and pushed."""

    IRREGULAR_RATE = 0.0

    def __init__(self) -> None:
        self.streams: list[Any] = []

    def StreamInfo(self, *said: Any) -> Any:  # noqa: N802 - as pylsl has it
        return FakeInfo(*said)

    def StreamOutlet(self, info: Any, max_buffered: int) -> Any:  # noqa: N802
        self.streams.append(info)
        return info


class FakeInfo:
    """A stream and its description, whose every node is itself."""

    def __init__(self, name: str, kind: str, channels: int, rate_hz: float, number: str, own_id: str) -> None:
        self.name, self.channels, self.own_id = name, channels, own_id
        self.pushed: list[tuple[list[Any], float]] = []

    def desc(self) -> "FakeInfo":
        return self

    def append_child(self, _: str) -> "FakeInfo":
        return self

    def append_child_value(self, *_: str) -> None:
        pass

    def push_sample(self, values: list[Any], time_s: float) -> None:
        assert len(values) == self.channels
        self.pushed.append((values, time_s))


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> FakeLsl:
    module = FakeLsl()
    monkeypatch.setattr(outlets, "lsl", lambda: module)
    return module


def streamed(*targets: int, object_name: str = "liner", skipped: int = 0, age_ns: int = 0) -> StreamedPoints:
    described = PointsDescription(
        number=1, device="north", rate_hz=50, calibration_id="c", object_name=object_name
    )
    frame = field(*targets)._replace(
        time_ns=time.monotonic_ns() - age_ns, utc_us=(time.time_ns() - age_ns) // 1000
    )
    return StreamedPoints(frame, described, skipped)


def test_an_object_with_other_targets_has_a_stream_of_its_own(fake: FakeLsl) -> None:
    layouts = [LAYOUT, LAYOUT, OTHER]
    north = Outlets("north", lambda: layouts.pop(0), LslClock(time.monotonic))
    north.push(streamed(7, 3))
    north.push(streamed(5))
    north.begin()  # the daemon was started again, with the same object
    north.push(streamed(7))
    north.push(streamed(7, 8, object_name="other"))
    events, points, other = fake.streams
    assert (events.name, points.name, other.name) == (
        "grabberd-north-events",
        "grabberd-north-points",
        "grabberd-north-points",
    )
    assert (len(points.pushed), len(other.pushed), layouts) == (3, 1, [])
    assert points.own_id != other.own_id


def test_times_grow_though_a_capture_measures_fields_before_its_trigger_afresh(fake: FakeLsl) -> None:
    north = Outlets("north", lambda: LAYOUT, LslClock(time.monotonic))
    for age_ns in (40_000_000, 20_000_000, 600_000_000, 20_000_000, 0):
        north.push(streamed(7, age_ns=age_ns))
    times_s = [time_s for _, time_s in fake.streams[1].pushed]
    assert times_s == sorted(times_s)
    assert len(times_s) in (3, 4)  # the second that is 20 ms old is a little younger than the first


def test_a_clock_that_was_set_back_does_not_silence_the_stream(fake: FakeLsl) -> None:
    north = Outlets("north", lambda: LAYOUT, LslClock(time.monotonic))
    north.push(streamed(7))
    north.push(streamed(7, age_ns=3_600_000_000_000))
    assert len(fake.streams[1].pushed) == 2


def test_fields_that_came_too_fast_are_told(fake: FakeLsl) -> None:
    north = Outlets("north", lambda: LAYOUT, LslClock(time.monotonic))
    north.push(streamed(7, skipped=4))
    [([text], _)] = fake.streams[0].pushed
    assert text == '{"event": "points_missed", "fields": 4}'


def test_without_pylsl_it_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pylsl", None)
    with pytest.raises(ExtraMissing) as caught:
        outlets.lsl()
    assert "pip install 'grabberd[lsl]'" in caught.value.hint


def test_an_inlet_that_stands_still_holds_nobody_up(tmp_path: Path, lsl: dict[str, str]) -> None:
    pipes: dict[str, Any] = {"env": lsl, "stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    commands = [PUSHING], [INLET, "north", tmp_path / "out"]
    pushing, inlet = (subprocess.Popen([sys.executable, *map(str, one)], **pipes) for one in commands)
    with pushing, inlet:
        try:
            assert inlet.stdout is not None
            assert inlet.stdout.readline() == "open\n"
            inlet.send_signal(signal.SIGSTOP)
            said, _ = pushing.communicate("go\n", timeout=PATIENCE_S)
        finally:
            inlet.kill()
            pushing.kill()
    samples, longest_s = said.split()
    assert int(samples) == 12_000
    assert float(longest_s) < 1
