"""The wall's material from a document: complete, or refused with all that is wrong."""

import pytest

from grabberd.errors import InputError
from grabberd_liner.analysis.grid import NominalShape
from grabberd_liner.analysis.wall.material import read_zones
from liner.analysis.collapsing import grid
from liner.analysis.wall.test_material import RUBBER, rubber


def test_one_material_serves_the_whole_liner():
    (zone,) = read_zones({**RUBBER, "E_sigma_mpa": 0.2}, grid())
    assert zone.material == rubber(E_sigma_mpa=0.2)
    assert zone.first_u_mm < grid().u_mm.min()
    assert zone.last_u_mm > grid().u_mm.max()


def test_zones_are_given_by_their_rows():
    soft = {**RUBBER, "rows": [9, 17], "E_mpa": 2.0}
    first, second = read_zones({"zones": [{**RUBBER, "rows": [0, 8]}, soft]}, grid())
    assert (first.material, second.material) == (rubber(), rubber(E_mpa=2.0))
    assert first.last_u_mm == pytest.approx(second.first_u_mm)


def test_all_that_is_missing_unknown_or_of_a_wrong_type_is_named():
    with pytest.raises(InputError) as caught:
        read_zones({"E_mpa": "3", "wall_mm": 2.5, "thickness": 2}, grid())
    for said in ("E_mpa: is '3'", "thickness: unknown key", "F0_n: is missing"):
        assert said in caught.value.message


def test_only_the_law_that_keeps_the_volume_gives_poisson_s_ratio():
    without = {key: value for key, value in RUBBER.items() if key not in ("law", "poisson")}
    assert read_zones(without, grid())[0].material.poisson == 0.5
    with pytest.raises(InputError, match="poisson: is missing"):
        read_zones({**without, "law": "linear"}, grid())


def test_without_a_radius_it_is_that_of_the_object_model():
    without = {key: value for key, value in RUBBER.items() if key != "radius_mm"}
    (zone,) = read_zones(without, grid())
    face_mm = NominalShape.of(grid()).radius_mm
    assert zone.material.radius_mm == pytest.approx(face_mm - zone.material.depth_mm)


@pytest.mark.parametrize("zones", [[], "all", [3], [{**RUBBER, "rows": [5, 2]}], [{**RUBBER, "rows": "0-8"}]])
def test_zones_that_are_none_are_refused(zones):
    with pytest.raises(InputError, match="zones"):
        read_zones({"zones": zones}, grid())


def test_values_that_no_wall_has_are_refused():
    with pytest.raises(InputError, match="wall_mm is 0, expected above 0"):
        read_zones({**RUBBER, "wall_mm": 0}, grid())
