"""Captures of format 1, written before there was another one, are read for ever."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from archive.capture.test_conversion import NOW, points_of
from archive.captures import computed_points, same_field, slot
from grabberd.archive.capture.conversion import convert
from grabberd.archive.capture.crash_recovery import recover
from grabberd.archive.capture.encodings import quantised
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.runs import append_run
from grabberd.archive.capture.verification import verify
from grabberd.archive.measure_setups import measure_setup
from grabberd.core.chain.measure import measure_fields
from grabberd.core.ledger import Outcome

FILES = Path(__file__).parents[1] / "format_1"


@pytest.fixture
def copied(tmp_path):
    return lambda name: Path(shutil.copy(FILES / name, tmp_path / name))


def test_a_capture_with_everything_comes_back_as_it_was_written(copied):
    path = copied("one-bit.grab")
    assert verify(path) == (11, 20, 0, True, [])
    with CaptureReader(path) as reader:
        reader.check_unchanged()
        told = [(one.numbered.n, one.outcome, one.reason) for one in reader.fields()]
        assert told[3:6] == [
            (3, Outcome.RECEIVED, None),
            (6, Outcome.RECEIVED, None),
            (7, Outcome.DAMAGED, "copied rows"),
        ]
        assert reader.ledger.counts()[Outcome.LOST] == 2
        assert reader.ledger.counts()[Outcome.NO_SIGNAL] == 1
        for one in reader.received():
            same_field(one, slot(one.n).numbered)
        for n, one in reader.points(1):
            assert one.xyz_mm.tobytes() == computed_points(n).xyz_mm.tobytes()
        assert [run.coverage for run in reader.runs] == [{"share": 0.9}, {"share": 0.8}]


@pytest.mark.parametrize(
    ("name", "bits", "doubled"), [("six-bits.grab", 6, False), ("eight-bits.grab", 8, True)]
)
def test_grey_captures_come_back_as_they_were_written(copied, name, bits, doubled):
    with CaptureReader(copied(name)) as reader:
        back = list(reader.received())
    for n, one in enumerate(back):
        same_field(one, slot(n, bits=bits, doubled=doubled).numbered)
    assert len(back) == 5


def test_what_a_kill_left_of_an_earlier_version_is_sealed(copied):
    path = recover(copied("killed.grab.part"))
    assert verify(path) == (10, 9, 0, True, [])
    with CaptureReader(path) as reader:
        assert reader.meta.state == "sealed"
        assert reader.ledger.received == 10
        assert reader.runs[0].state == "failed"


def test_a_run_is_added_in_the_format_of_the_file(copied):
    path = copied("one-bit.grab")
    run = append_run(path, "measure", "", "", {}, ((n, computed_points(n)) for n in (0, 1, 6)))
    with CaptureReader(path) as reader:
        back = dict(reader.points(run))
    assert {n: one.xyz_mm.tobytes() for n, one in back.items()} == {
        n: computed_points(n).xyz_mm.tobytes() for n in (0, 1, 6)
    }
    assert verify(path).damages == []


def test_what_is_measured_from_either_format_is_the_same_but_for_the_rounding(copied):
    path = copied("simulated.grab")
    with CaptureReader(path) as reader:
        made_with = reader.run(1).made_with
    setup = measure_setup(made_with, made_with["settings"])

    def measured_again():
        with CaptureReader(path) as reader:
            measured = ((one.n, one.points) for one in measure_fields(reader.received(), setup))
            return points_of(path, append_run(path, "measure", "", "", made_with, measured))

    first = measured_again()
    convert(path, NOW)
    second = measured_again()
    assert list(first) == list(second) == list(range(25))
    for n, one in first.items():
        assert second[n].target.tolist() == one.target.tolist()
        assert second[n].xyz_mm.tobytes() == quantised(one).xyz_mm.tobytes()
        np.testing.assert_allclose(second[n].image_px, one.image_px, rtol=0, atol=0.6e-3)


def test_a_simulated_capture_takes_a_third_of_its_room_when_it_is_converted(copied):
    path = copied("simulated.grab")
    with CaptureReader(path) as reader:
        before = [(one.numbered, one.numbered.packed.data.copy()) for one in reader.fields()]
    sizes = convert(path, NOW)
    assert sizes.after_bytes < 0.45 * sizes.before_bytes
    with CaptureReader(path) as reader:
        for (numbered, data), one in zip(before, reader.fields(), strict=True):
            assert numbered[:3] == one.numbered[:3]
            np.testing.assert_array_equal(data, one.numbered.packed.data)
