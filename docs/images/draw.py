"""Draws the pictures in docs/images from simulated fields. `make docs` runs it.

field.jpg: one field of 1 bit, its targets ringed. model.png: the surface of another, coloured by height.
overlay.jpg: the synthetic views of the same, over the camera's pictures. analysis-model.svg,
analysis-curves.svg: figures of the report of an analysis with the inputs that are shipped.
target-over-time.svg, errors-over-sigma.svg: plots of the captures that come with the library.
"""

import csv
import shutil
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

import grabberd
from grabberd.config import default_config_file, load_config, shipped_configs
from grabberd.core.chain.measure import MeasuredField, MeasureSetup, measure_fields
from grabberd.core.field import Field, NumberedField, PackedField, double_lines, quantise
from grabberd.files.reading import read_yaml
from grabberd.instrument.setup import set_up
from grabberd_fake import FakeGrabber, JumpingClock
from grabberd_liner.analysis.grid import Grid
from grabberd_liner.analysis.pulsation.movement import TimedPoints
from grabberd_liner.analysis.surface.surface import Surface
from grabberd_liner.chain.analysis.analyse import analyse
from grabberd_liner.chain.analysis.analysis_document import analysis_document
from grabberd_liner.chain.analysis.inputs import read_inputs
from grabberd_liner.chain.analysis.tables import tables
from grabberd_liner.chain.analysis.wall_state import FieldPoints
from grabberd_liner.render import synthetic_view
from grabberd_liner.render.model_pictures import Gallery, Modelling
from grabberd_liner.render.wire_model import SIDES, Look
from grabberd_liner.reports.columns import Columns
from grabberd_liner.reports.figures import model_svg, states_of, time_svg

THRESHOLD = 60
SCALE = 2
OPEN, CLOSED = 20, 45
"""Fields in which the liner is open and closed."""
ANALYSED = 100
"""Fields: two cycles."""
PERIOD_NS = 20_000_000
MOVING = 51
"""A target of the liner that moves far."""
LINES, LEFT, RIGHT = slice(190, 400), slice(118, 238), slice(480, 600)
RING, INK, SEAM = (80, 220, 255), (120, 200, 120), (90, 90, 90)


def main() -> None:
    """Grabs, measures, draws and writes."""
    fields, folder, setup = _grabbed(CLOSED + 1), Path(__file__).parent, _setup()
    doubled = double_lines(fields[OPEN])
    ringed = drawn(doubled, _measured([quantise(doubled, 1, THRESHOLD)], setup)[0])
    cv2.imwrite(str(folder / "field.jpg"), ringed, [cv2.IMWRITE_JPEG_QUALITY, 82])
    measured = _measured([quantise(field, 8, THRESHOLD) for field in fields], setup)
    modelling = Modelling.of(setup.object_model, [one.points for one in measured])
    cv2.imwrite(str(folder / "model.png"), model(modelling, measured))
    overlay = laid_over(modelling.surface(measured[-1].points), setup, fields[-1])
    cv2.imwrite(str(folder / "overlay.jpg"), overlay, [cv2.IMWRITE_JPEG_QUALITY, 90])
    for name, figure in analysis(setup).items():
        (folder / f"analysis-{name}.svg").write_text(figure, encoding="utf-8")
    # Text as text and ids that stay the same: small files that change only with what they show.
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": "grabberd", "font.size": 11}):
        for name, plot in examples().items():
            plot.savefig(folder / f"{name}.svg", metadata={"Date": None})


def examples() -> dict[str, Figure]:
    """Plots of the captures that come with the library, as its notebooks draw them."""
    figure = plt.figure(figsize=(8, 3), layout="constrained")
    grabberd.open(grabberd.example("liner.grab")).plot_target(MOVING, "z", ax=figure.subplots())
    return {"target-over-time": figure, "errors-over-sigma": errors_over_sigma()}


def errors_over_sigma() -> Figure:
    """Histograms of the accuracy object's errors in units of their σ, after a calibration of the rig."""
    calibration = grabberd.calibrate(
        grabberd.example("frame.grab"), grabberd.example("calibration-frame.yaml")
    )
    with TemporaryDirectory() as folder:
        capture = grabberd.open(shutil.copy(grabberd.example("object.grab"), folder))
        capture.measure(calibration)
        points = capture.points()
    with grabberd.example("object-truth.csv").open(encoding="utf-8") as file:
        truth = {(int(row["n"]), int(row["target"])): row for row in csv.DictReader(file)}
    rows = [truth[n, target] for n, target in zip(points["n"], points["target"], strict=True)]
    figure = plt.figure(figsize=(9, 2.8), layout="constrained")
    for axes, axis in zip(figure.subplots(1, 3, sharey=True), "xyz", strict=True):
        error = points[f"{axis}_mm"] - np.array([float(row[f"{axis}_mm"]) for row in rows])
        sigma = np.hypot(points[f"sigma_{axis}_mm"], points[f"calibration_sigma_{axis}_mm"])
        axes.hist(error / sigma, bins=np.linspace(-4, 4, 33), density=True)
        z = np.linspace(-4, 4, 100)
        axes.plot(z, np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi))
        axes.set(title=f"error of {axis} / σ", xlim=(-4, 4))
    return figure


def model(modelling: Modelling, measured: list[MeasuredField]) -> NDArray[np.uint8]:
    """(600, 960, 3) uint8: the model at the last field."""
    last = measured[-1]
    gallery = Gallery.of(modelling, [last.points], measured[0].points, "height")
    return gallery.picture(last.points, Look(*SIDES["oblique"]), f"field {last.n}")


def laid_over(surface: Surface, setup: MeasureSetup, field: Field) -> NDArray[np.uint8]:
    """Parts of both synthetic views over the camera's, side by side and enlarged."""
    pair = synthetic_view.synthetic_pair(surface, setup.calibration, field, fitted=False)
    over = synthetic_view.laid_over(synthetic_view.frame_of(pair, setup.calibration), field)
    parts = np.concatenate([over[LINES, LEFT], over[LINES, RIGHT]], axis=1)
    return np.asarray(cv2.resize(parts, None, fx=3, fy=3, interpolation=cv2.INTER_CUBIC), np.uint8)


def analysis(setup: MeasureSetup) -> dict[str, str]:
    """Figures of an analysis' report: the wall with its pressure, and curves over time."""
    measured = _measured([quantise(field, 8, THRESHOLD) for field in _grabbed(ANALYSED)], setup)
    fields = [FieldPoints(one.n, TimedPoints(one.n * PERIOD_NS / 1e9, one.points)) for one in measured]
    grid = Grid.of(setup.object_model)
    inputs = read_inputs(read_yaml(shipped_configs() / "analysis" / "liner.yaml"), grid)
    found = analyse([fields], grid, inputs)
    document = analysis_document(found, tables(found), {})
    states, label = states_of(document), "Model of the wall and map of its pressure"
    columns = {name: Columns(table) for name, table in document["tables"].items()}
    figures = {
        "model": model_svg(states, "contact_kpa", "pressure", f"{label} in {len(states)} states"),
        "curves": time_svg(columns, "Curves over time with bands of one σ"),
    }
    return {name: _on_white(figure) for name, figure in figures.items()}


def _on_white(figure: str) -> str:
    return figure.replace("<svg ", '<svg style="background: white" ', 1) + "\n"


def drawn(field: Field, measured: MeasuredField) -> NDArray[np.uint8]:
    """(rows, columns, 3) uint8: the field, enlarged, each target ringed in both views, with its id in one."""
    big = cv2.resize(field.luma, None, fx=SCALE, fy=SCALE, interpolation=cv2.INTER_CUBIC)
    picture = cv2.cvtColor(big, cv2.COLOR_GRAY2BGR)
    middle = picture.shape[1] // 2
    cv2.line(picture, (middle, 0), (middle, picture.shape[0]), SEAM, 1)
    for target, views in zip(measured.points.target, measured.points.image_px, strict=True):
        for view, (x, y) in enumerate(views):
            place = (round(SCALE * x), round(SCALE * y))
            cv2.circle(picture, place, 11, RING, 1, cv2.LINE_AA)
            if view == 0:
                corner = (place[0] + 12, place[1] + 4)
                cv2.putText(picture, str(target), corner, cv2.FONT_HERSHEY_SIMPLEX, 0.33, INK, 1, cv2.LINE_AA)
    return np.asarray(picture, np.uint8)


def _grabbed(count: int) -> list[Field]:
    grabber = FakeGrabber(clock=JumpingClock(), pace="free", picture={"stamp": False})
    grabber.open()
    kept: list[Field] = []
    try:
        while len(kept) < count:
            with grabber.dequeue(1.0) as fields:
                kept += [Field.intact(one.field.luma.copy(), one.field.parity) for one in fields]
    finally:
        grabber.close()
    return kept[:count]


def _setup() -> MeasureSetup:
    file = default_config_file()
    setup = next(iter(set_up(load_config(file), file).values())).measuring
    assert setup
    return setup


def _measured(packed: list[PackedField], setup: MeasureSetup) -> list[MeasuredField]:
    numbered = (NumberedField(n, n * PERIOD_NS, n, one) for n, one in enumerate(packed))
    return list(measure_fields(numbered, setup))


if __name__ == "__main__":
    main()
