"""The stage: what is before the simulated camera, rearranged while grabber and logger run."""

import json
import logging
from pathlib import Path

import numpy as np
import pytest

from drivers.fake.taking import PERIOD, MakeGrabber, taken
from grabberd.errors import DeviceRefused, StreamFailed
from grabberd.testing import ManualClock
from grabberd_fake import FakeGrabber, FakeLogger, JumpingClock, World
from grabberd_fake.__main__ import main
from grabberd_fake.liner_options import LinerOptions
from grabberd_fake.stage import REARRANGED, on_stage, ramp, read_stage, write_stage
from grabberd_fake.vacuum import pulsation_kpa
from grabberd_fake.wall_states import touch_kpa, wall_names, wall_states

EMPTY = "wall: thin-empty\n"
BAD = "wall: cow\nperiod_s: 0\nrows: 3\n"


@pytest.fixture
def stage(tmp_path: Path) -> Path:
    return tmp_path / "stage.yaml"


def staged(make: MakeGrabber, stage: Path) -> FakeGrabber:
    return make(scene="liner", stage=str(stage), liner={"period_s": 0.9})[0]


def test_without_the_file_everything_is_as_configured(grabber: MakeGrabber, stage: Path) -> None:
    assert staged(grabber, stage).options.liner == LinerOptions(period_s=0.9)


def test_what_the_file_does_not_name_is_as_configured(grabber: MakeGrabber, stage: Path) -> None:
    stage.write_text(EMPTY)
    assert staged(grabber, stage).options.liner == LinerOptions("thin-empty", period_s=0.9)


def test_the_stream_says_what_was_on_stage_when_it_began(stage: Path) -> None:
    stage.write_text(EMPTY)
    made = FakeGrabber(clock=JumpingClock(), scene="liner", stage=str(stage))
    assert json.loads(made.open().details["stage"]) == {"wall": "thin-empty"}


def test_a_change_ends_the_stream_and_the_next_one_shows_it(grabber: MakeGrabber, stage: Path) -> None:
    made = staged(grabber, stage)
    stage.write_text(EMPTY)
    with pytest.raises(StreamFailed, match=REARRANGED):
        taken(made, 1)
    assert json.loads(made.restart().details["stage"]) == {"wall": "thin-empty"}
    (after,) = taken(made, 1)
    thin, number = World(made.options), after.time_ns // PERIOD
    picture = np.empty_like(after.field.luma)
    thin.picture(number, picture)
    assert (after.field.luma == picture).all()
    assert made.options.liner.wall == "thin-empty"


def test_the_file_taken_away_gives_back_what_is_configured(grabber: MakeGrabber, stage: Path) -> None:
    stage.write_text(EMPTY)
    made = staged(grabber, stage)
    stage.unlink()
    with pytest.raises(StreamFailed):
        taken(made, 1)
    made.restart()
    assert made.options.liner == LinerOptions(period_s=0.9)


def test_the_same_content_again_interrupts_nothing(grabber: MakeGrabber, stage: Path) -> None:
    stage.write_text(EMPTY)
    made = staged(grabber, stage)
    stage.write_text(f"# still\n{EMPTY}")
    assert len(taken(made, 2)) == 2


def test_without_a_usable_stage_it_is_refused_with_all_problems(stage: Path) -> None:
    stage.write_text(BAD)
    made = FakeGrabber(clock=JumpingClock(), scene="liner", stage=str(stage))
    for _ in range(2):
        with pytest.raises(DeviceRefused) as refused:
            made.open()
        for key in ("wall: 'cow'", "period_s: 0", "rows: not on a stage"):
            assert key in refused.value.message
    stage.write_text(EMPTY)
    made.open()


def test_a_later_one_that_cannot_be_used_leaves_the_stage_as_it_was(
    grabber: MakeGrabber, stage: Path, caplog: pytest.LogCaptureFixture
) -> None:
    stage.write_text(EMPTY)
    made = staged(grabber, stage)
    stage.write_text(BAD)
    with caplog.at_level(logging.WARNING):
        assert len(taken(made, 5)) == 5
    (complaint,) = caplog.messages
    assert "the stage stays as it was" in complaint
    assert "wall: 'cow'" in complaint
    made.restart()
    assert made.options.liner.wall == "thin-empty"


@pytest.mark.parametrize("content", ["- wall", "wall: [", "\x00"])
def test_a_file_that_is_no_mapping_is_refused(stage: Path, content: str) -> None:
    stage.write_text(content)
    with pytest.raises(ValueError, match=r"stage\.yaml"):
        read_stage(stage)


def test_a_scene_without_a_liner_has_no_stage(stage: Path) -> None:
    for driver in (FakeGrabber, FakeLogger):
        with pytest.raises(ValueError, match="stage: given, but the scene is 'ellipse'"):
            driver(scene="ellipse", stage=str(stage))


def test_the_logger_reads_on_and_follows(stage: Path) -> None:
    clock = ManualClock()
    logger = FakeLogger(clock=clock, dating="monotonic", noise_kpa=0.0, stage=str(stage))
    logger.open()
    assert logger.read(0.1).values[:, 1] == pytest.approx(42.0)
    assert main(["stage", str(stage), "--no-vacuum"]) == 0
    assert logger.read(0.1).values[:, :2] == pytest.approx(0.0)


def test_the_command_changes_what_it_is_told_and_leaves_the_rest(stage: Path) -> None:
    for arguments in (["--wall", "wide-empty", "--ramp"], ["--wall", "wide-round"], ["--milking"]):
        assert main(["stage", str(stage), *arguments]) == 0
    assert read_stage(stage) == {"wall": "wide-round"}
    assert [path.name for path in stage.parent.iterdir()] == ["stage.yaml"]


def test_the_command_adds_nothing_to_a_stage_that_cannot_be_used(
    stage: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stage.write_text(BAD)
    with pytest.raises(SystemExit):
        main(["stage", str(stage), "--no-vacuum"])
    assert "rows: not on a stage" in capsys.readouterr().err
    assert stage.read_text() == BAD


def test_a_ramp_goes_beyond_the_touch_of_every_liner(grabber: MakeGrabber, stage: Path) -> None:
    assert main(["stage", str(stage), "--ramp"]) == 0
    wave = staged(grabber, stage).options.liner.wave
    touches = [touch_kpa(wall_states(name)) for name in wall_names() if name.endswith("empty")]
    assert max(touches) < wave.system_kpa == wave.liner_kpa


def test_a_ramp_begins_with_ten_seconds_of_an_open_liner(stage: Path) -> None:
    liner = on_stage(LinerOptions(), write_stage(stage, ramp(1234.0)), stage)
    difference = liner.wave.liner_kpa - pulsation_kpa(
        liner, np.array([1234.0, 1235.1, 1244.9, 1295.1, 1313.9])
    )
    assert difference == pytest.approx([20, 0, 0, 20, 20], abs=0.05)
