"""Analysis of a capture of the simulated grabber, from its file."""

from pathlib import Path

import numpy as np
import pytest

from grabberd.acquisition import Outcome
from grabberd.acquisition.ring import Slot
from grabberd.service.jobs.analysis import analyse_file
from grabberd.storage import CaptureWriter
from processes.fake_scene import take_scene
from storage.captures import ledger_of, meta
from storage.milkings import object_document

MATERIAL = {
    "law": "neo_hookean",
    "E_mpa": 3.0,
    "E_sigma_mpa": 0.1,
    "wall_mm": 2.5,
    "wall_sigma_mm": 0.05,
    "poisson": 0.5,
    "F0_n": 60.0,
    "F0_sigma_n": 3.0,
    "radius_mm": 12.5,
    "target_mm": 0.0,
    "first_end_mm": -65.0,
    "last_end_mm": 65.0,
}
VACUUM = {name: {"kpa": 42.0, "sigma_kpa": 0.3} for name in ("pulsation", "liner")}
INPUTS = {"reference": "nominal", "material": MATERIAL, "vacuum": VACUUM, "sought_kpa": 5.0}


@pytest.fixture(scope="module")
def opened(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three fields of the open liner, of whose six columns both views see four."""
    scene = take_scene(40)
    measured = scene.measured(8, "field")
    # An open liner hides more of its outermost columns than a closed one.
    opened = sorted(one.n for one in sorted(measured, key=lambda one: len(one.points))[:3])
    made_with = {
        "calibration": scene.setup.calibration.to_document(),
        "object": object_document(scene.setup.object_model),
        "settings": {"line_jitter_px": scene.setup.line_jitter_px},
    }
    path = tmp_path_factory.mktemp("opened") / "opened.grab.part"
    writer = CaptureWriter.create(path, meta(bits=8))
    writer.begin_run(1, "live", "2026-03-01T09:30:00.000Z", "0.1.0", made_with)
    fields = [one for one in scene.packed(8, "field") if one.n in opened]
    taken = [Slot(one, one.n, Outcome.RECEIVED, None, (), one.time_ns) for one in fields]
    writer.append(taken)
    for n in opened:
        writer.append_points(1, n, measured[n].points)
    writer.commit()
    return writer.seal(ledger_of(taken), complete=True, ended_because="length reached")


def test_targets_that_one_view_alone_sees_have_a_pressure_but_no_point(opened: Path) -> None:
    analysis = analyse_file(lambda share: None, path=opened, inputs=INPUTS).analysis
    outermost = np.isin(analysis.grid.column, (0, analysis.grid.column.max()))
    for field, state in zip(analysis.fields, analysis.states, strict=True):
        alone = outermost & ~np.isin(analysis.grid.target, field.timed.points.target)
        assert alone.sum() > 10
        assert state.pressure is not None
        assert state.pressure.supported[alone].all()
        # Nothing presses on an open liner.
        assert np.abs(state.pressure.contact_kpa.value[alone]).max() < 3.0


def test_without_what_a_pressure_needs_the_fields_are_not_located_again(
    opened: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("grabberd.processes.single_views.single_view_images", None)
    made = analyse_file(lambda share: None, path=opened, inputs={"reference": "nominal"})
    assert all(state.pressure is None for state in made.analysis.states)
