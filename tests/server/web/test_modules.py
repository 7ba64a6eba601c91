"""The page's own logic, run by Node where it is installed: tests/server/web/modules/*.test.mjs."""

import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from grabberd.core.geometry import Calibration, project

MODULES = Path(__file__).parent / "modules"
STATIC = Path(__file__).parents[3] / "src" / "grabberd" / "server" / "web" / "static"
EXAMPLE = Path(__file__).parents[3] / "configs" / "fake.calibration.json"
LEAST_VERSION = (20, 19)
"""The first that takes a file for a module by what is in it."""
NODE = shutil.which("node")


def _missing() -> str:
    if NODE is None:
        return "Node is missing: sudo apt-get install nodejs"
    answer = subprocess.run([NODE, "--version"], capture_output=True, text=True, check=True).stdout
    version = tuple(int(part) for part in re.findall(r"\d+", answer)[:2])
    return "" if version >= LEAST_VERSION else f"Node {answer.strip()} is too old, 20.19 is needed"


needs_node = pytest.mark.skipif(bool(_missing()), reason=_missing())


@needs_node
@pytest.mark.parametrize("file", sorted(MODULES.glob("*.test.mjs")), ids=lambda file: file.stem)
def test_what_the_modules_promise(file: Path) -> None:
    command = [str(NODE), "--test", str(file)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def rays(calibration: dict[str, object], places: list[list[float]]) -> list[list[list[float]]]:
    """The page's own directions, view by view, of frame pixels."""
    script = f"""
        import {{ rayOf }} from {json.dumps(str(STATIC / "js" / "scene" / "frustum.js"))};
        const views = Object.values({json.dumps(calibration["views"])});
        const places = {json.dumps(places)};
        console.log(JSON.stringify(views.map((view, i) => places[i].map(([x, y]) => rayOf(view, x, y)))));
    """
    command = [str(NODE), "--input-type=module", "--eval", script]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    found: list[list[list[float]]] = json.loads(done.stdout)
    return found


@needs_node
@pytest.mark.parametrize("handedness", [1, -1])
def test_its_cameras_look_where_the_calibration_says(handedness: int) -> None:
    document = json.loads(EXAMPLE.read_text())
    for view in document["views"].values():
        view.update(b=[0.0] * 9, handedness=handedness)
    calibration = Calibration.from_document(document)
    xyz_mm = np.array([[-40.0, 5.0, 3.0], [0.0, 0.0, 0.0], [30.0, -9.0, -4.0]])
    images = [project(view, xyz_mm).tolist() for view in calibration.views]
    for view, directions in zip(calibration.views, rays(document, images), strict=True):
        toward = xyz_mm - view.center_mm
        apart = np.cross(np.array(directions), toward) / np.linalg.norm(toward, axis=1, keepdims=True)
        assert np.abs(apart).max() < 1e-9
        assert (np.array(directions) * toward).sum(axis=1).min() > 0
