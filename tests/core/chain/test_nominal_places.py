"""Nominal places corrected by a capture, on the simulated liner whose true places are known."""

from dataclasses import replace

import numpy as np
import pytest

from core.chain.fake_scene import take_scene
from grabberd.core.chain.measure import measure_fields
from grabberd.core.chain.nominal_places import NominalPlaces, nominal_places

FAR = {57: (0.0, 0.0, 1.3), 33: (0.39, 0.0, 0.0)}


@pytest.fixture(scope="module")
def liner():
    return take_scene(100)


def misplaced(setup, offsets):
    """A setup whose object model has some targets elsewhere."""
    model = setup.object_model
    xyz_mm = model.xyz_mm.copy()
    for target, offset in offsets.items():
        xyz_mm[np.searchsorted(model.target, target)] += offset
    return replace(setup, object_model=replace(model, xyz_mm=xyz_mm))


def found(scene, setup, target):
    """Number of fields that a target is found in."""
    return sum(target in one.points.target for one in measure_fields(scene.packed(1, "doubled"), setup))


def seen(scene, setup, bits=1):
    return nominal_places(scene.packed(bits, "doubled" if bits == 1 else "field"), setup)


@pytest.mark.parametrize("bits", [1, 8])
def test_targets_elsewhere_are_found_and_put_where_they_are(liner, bits):
    setup = misplaced(liner.setup, FAR)
    places = seen(liner, setup, bits)
    assert places.model.target[places.misplaced].tolist() == sorted(FAR)
    off = places.proposed.xyz_mm - liner.setup.object_model.xyz_mm
    assert np.abs(off[places.misplaced]).max() < 0.2
    assert (np.abs(off) <= 3.5 * places.proposed.target_sigma_mm[:, np.newaxis]).all()


def test_what_was_dropped_is_found_with_the_proposed_model(liner):
    setup = misplaced(liner.setup, FAR)
    before = found(liner, setup, 57)
    after = found(liner, replace(setup, object_model=seen(liner, setup).proposed), 57)
    assert before < 96
    assert after >= 98


def test_a_model_that_is_right_is_left_alone(liner):
    places = seen(liner, liner.setup)
    assert not places.misplaced.any()
    assert np.array_equal(places.proposed.xyz_mm, liner.setup.object_model.xyz_mm)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2, 8))
def test_no_target_in_place_is_moved(seed):
    scene = take_scene(60, seed=seed, rig={"seed": seed})
    assert not seen(scene, scene.setup, 8 if seed % 2 else 1).misplaced.any()


def test_without_fields_nothing_is_told(liner):
    places = nominal_places([], liner.setup)
    assert isinstance(places, NominalPlaces)
    assert not places.misplaced.any()
    assert places.fields == 0


def test_too_few_fields_move_nothing(liner):
    few = list(liner.packed(1, "doubled"))[:6]
    assert not nominal_places(few, misplaced(liner.setup, FAR)).misplaced.any()
