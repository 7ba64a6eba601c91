"""A light that was recorded with a capture dates its other channels by the fields themselves."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from archive.captures import ledger_of, meta
from archive.milkings import object_document
from core.chain.fake_scene import Scene, take_scene
from grabberd.archive.capture.reading_groups import (
    ChannelCalibration,
    RecordedChannel,
    RecordedReadings,
)
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.core.channels import Quantity, Readings
from grabberd.core.ledger import Outcome, Slot
from grabberd.errors import InputError
from grabberd.testing import ManualClock
from grabberd_fake import FakeLight, FakeLogger
from grabberd_fake.liner_options import LinerOptions
from grabberd_fake.vacuum import pulsation_kpa
from grabberd_liner.analyses.job import analyse_file
from grabberd_liner.analyses.source import channel_curves, found_light
from grabberd_liner.chain.analysis.vacuum_inputs import read_vacuum

LAMP = {"diameter_px": 9.0, "x_px": 640.0, "y_px": 24.0}
FIELDS = 14 * 50
FIRST = 12
"""The first field that is captured: there are readings from a quarter of a second before it on."""
CAMERA_LATE_S = 0.031
"""The camera's stamps are late by so much, which only the light can tell."""
DELAY_SIGMA_MS = 4.0
BY_LIGHT = {"vacuum": {"pulsation": "channel", "liner": "channel", "offset": "light"}}


@pytest.fixture(scope="module")
def scene() -> Scene:
    return take_scene(FIELDS, light=LAMP)


def said(logger: FakeLight | FakeLogger, clock: ManualClock, end_ns: int) -> Iterator[Readings]:
    logger.open()
    while clock.time_ns < end_ns:
        yield logger.read(0.1)


def recorded(path: Path, scene: Scene, light: str | None) -> Path:
    """The scene's capture with the vacuum, whose logger has the light as well, or leaves it to its switch."""
    first_ns, end_ns = scene.fields[0][0], scene.fields[-1][0] + 10**9
    calibrations = [ChannelCalibration("kPa", 1.0, 0.0, 0.2, None, 0.0, DELAY_SIGMA_MS)] * 2
    calibrations += [ChannelCalibration("level", 1.0, 0.0, 0.0, None, 0.0, 0.02)] * (light is not None)
    quantities = (Quantity.PULSATION, Quantity.LINER, Quantity.LIGHT)
    names = ("tank", "tank", light or "")
    channels = [
        RecordedChannel(number, str(quantity), quantity, logger, calibration, {})
        for number, (quantity, logger, calibration) in enumerate(
            zip(quantities, names, calibrations, strict=False)
        )
    ]
    writer = CaptureWriter.create(path, meta(), channels=channels)
    documents = {
        "calibration": scene.setup.calibration.to_document(),
        "object": object_document(scene.setup.object_model),
        "settings": {"line_jitter_px": scene.setup.line_jitter_px},
    }
    writer.begin_run(1, "live", "2026-03-01T09:30:00.000Z", "0.1.0", documents)
    late_ns = round(CAMERA_LATE_S * 1e9)
    fields = [
        one._replace(n=one.n - FIRST, time_ns=one.time_ns + late_ns)
        for one in scene.packed(1, "doubled")
        if one.n >= FIRST
    ]
    taken = [Slot(one, one.n, Outcome.RECEIVED, None, (), one.time_ns) for one in fields]
    writer.append(taken)
    for one in scene.measured(1, "doubled")[FIRST:]:
        writer.append_points(1, one.n - FIRST, one.points)
    clock = ManualClock()
    clock.time_ns = first_ns
    with_light = {"light": LAMP} if light == "tank" else {}
    for part in said(FakeLogger(clock=clock, dating="monotonic", **with_light), clock, end_ns):
        for place in (0, 1, *([4] if light == "tank" else [])):
            keep(writer, min(place, 2), part, place)
    if light == "lamp":
        clock.time_ns = first_ns
        for part in said(FakeLight(clock=clock, light=LAMP), clock, end_ns):
            keep(writer, 2, part, 0)
    writer.commit()
    return writer.seal(ledger_of(taken), complete=True, ended_because="length reached")


def keep(writer: CaptureWriter, number: int, part: Readings, place: int) -> None:
    if len(part.time_ns):
        values = RecordedReadings(part.time_ns, part.values[:, place], "monotonic", part.time_sigma_ns)
        writer.append_readings(number, values)


@pytest.mark.parametrize("light", ["lamp", "tank"])
def test_the_cameras_delay_is_found_and_the_channels_are_dated_by_the_fields(
    scene: Scene, tmp_path: Path, light: str
) -> None:
    path = recorded(tmp_path / "lit.grab.part", scene, light)
    vacuum = BY_LIGHT["vacuum"]
    found = found_light(path, vacuum)
    assert found is not None
    clock = found.clock
    assert abs(clock.offset_s - CAMERA_LATE_S) < min(3.5 * clock.offset_sigma_s, 1e-3)
    time_s = np.arange(FIELDS - FIRST) * 0.02
    dated = read_vacuum(vacuum, None, time_s, found, channel_curves(path, BY_LIGHT))
    assert dated is not None
    truth = pulsation_kpa(LinerOptions(), time_s + FIRST * 0.02)
    told = np.array([one.pulsation_kpa for one in dated.at(time_s)])
    # 300 kPa/s on a flank: a millisecond is 0.3 kPa, the camera's delay would be 9.
    assert np.abs(told - truth).max() < 1.5
    # What the vacuum's logger is late by remains unless it has recorded the light itself.
    least_s = DELAY_SIGMA_MS / 1e3 if light == "lamp" else 0.0
    assert np.hypot(least_s, clock.offset_sigma_s) <= dated.time_sigma_s < np.hypot(least_s, 7e-4)


def test_a_capture_without_a_light_says_which_channels_it_has(scene: Scene, tmp_path: Path) -> None:
    path = recorded(tmp_path / "dark.grab.part", scene, None)
    with pytest.raises(InputError, match="the capture has no channel light") as refused:
        analyse_file(lambda share: None, path=path, inputs=BY_LIGHT)
    assert "pulsation, liner" in refused.value.hint
