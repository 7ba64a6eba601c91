"""The notebooks run from their first cells to their last, and find what they say."""

import json
import warnings
from pathlib import Path
from typing import Any

import pytest

NOTEBOOKS = Path(__file__).parents[1] / "docs" / "notebooks"


def cells(name: str) -> list[dict[str, Any]]:
    found = json.loads((NOTEBOOKS / f"{name}.ipynb").read_text())["cells"]
    return [cell for cell in found if cell["cell_type"] == "code"]


def run(name: str) -> dict[str, Any]:
    """The names that a notebook leaves behind, and as `figures` the number of its pictures."""
    matplotlib = pytest.importorskip("matplotlib")
    pytest.importorskip("xarray")
    matplotlib.use("agg")
    names: dict[str, Any] = {}
    with warnings.catch_warnings():
        for cell in cells(name):
            exec(compile("".join(cell["source"]), cell["id"], "exec"), names)
    figures = len(names["plt"].get_fignums())
    names["plt"].close("all")
    return names | {"figures": figures}


def test_a_first_look_shows_fields_and_points() -> None:
    names = run("first_look")
    assert names["figures"] == 5
    assert len(names["points"]) > 10_000
    assert 5 < float(names["amplitude"].max()) < 15


def test_a_calibration_is_judged_by_the_truth(capsys: pytest.CaptureFixture[str]) -> None:
    names = run("calibrate_and_judge")
    assert names["figures"] == 2
    assert 0.7 < names["found"].single.chi2 < 1.3
    assert "passed" in capsys.readouterr().out


@pytest.mark.slow
def test_points_become_the_load_on_the_teat() -> None:
    names = run("points_to_load")
    assert names["figures"] == 6
    load = names["analysis"].quantities["teat_load_n"]
    assert 0 < load.sigma < load.value
    assert names["analysis"].problems == ()


@pytest.mark.parametrize("name", sorted(path.stem for path in NOTEBOOKS.glob("*.ipynb")))
def test_they_are_kept_without_their_outputs(name: str) -> None:
    assert all(cell["outputs"] == [] for cell in cells(name))


def test_they_import_the_library_alone() -> None:
    """Readers copy what they see: nothing but public names."""
    for path in NOTEBOOKS.glob("*.ipynb"):
        source = "".join(line for cell in cells(path.stem) for line in cell["source"])
        assert "grabberd." in source
        assert "from grabberd" not in source
        assert "import grabberd." not in source
