"""The notebook runs from its first cell to its last, and finds what it says."""

import json
from pathlib import Path

import numpy as np
import pytest

NOTEBOOK = Path(__file__).parents[1] / "docs" / "notebooks" / "capture.ipynb"


def cells():
    return [cell for cell in json.loads(NOTEBOOK.read_text())["cells"] if cell["cell_type"] == "code"]


@pytest.mark.slow
def test_the_notebook_goes_from_a_capture_to_its_pressure(capsys):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("agg")
    names: dict[str, object] = {}
    for cell in cells():
        exec(compile("".join(cell["source"]), cell["id"], "exec"), names)
    pyplot = names["plt"]
    assert len(pyplot.get_fignums()) == 8
    pyplot.close("all")
    found = names["found"]
    assert len(found.states) == 64
    assert abs(found.cycle.pulsation.period_s - 0.64) < 0.002
    error = (names["contact"].value - names["true"])[names["shown"]]
    assert np.abs(error / names["contact"].sigma[names["shown"]]).mean() < 3
    assert "errors over σ" in capsys.readouterr().out


def test_it_is_kept_without_its_outputs():
    assert [cell["outputs"] for cell in cells()] == [[]] * len(cells())
