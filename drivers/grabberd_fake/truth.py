"""Truth at a time, for options or for every field of a capture file."""

import json
import sqlite3
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grabberd.errors import CaptureFileError
from grabberd_fake.ellipse_truth import truth_of_wall
from grabberd_fake.liner_truth import quantities_of, truth_of_liner
from grabberd_fake.optics import Array
from grabberd_fake.options import FakeOptions
from grabberd_fake.stage import REARRANGED, on_stage
from grabberd_fake.teat_mat import Mat, mat_lines
from grabberd_fake.vacuum import Pulsating, vacuum_log
from grabberd_fake.world import Truth, World

CSV_HEADER = "n,time_ns,target,x_mm,y_mm,z_mm,visible"
LINER_CSV_HEADER = (
    "n,time_ns,target,x_mm,y_mm,z_mm,strain_11,strain_12,strain_22,p_contact_kpa,"
    "rest_kpa,pulsation_vacuum_kpa,liner_vacuum_kpa"
)
LOAD_CSV_HEADER = "n,time_ns,x_mm,load_n_per_mm"
_TENSORS = ("strain", "curvature_per_m", "tension_n_per_m", "moment_n")
_MIDDLE = ("n", "time_ns", "target", "x_mm", "y_mm", "z_mm")
_ALL = ("stretch_1", "stretch_2", "p_contact_kpa", "wall_kpa", "pulsation_vacuum_kpa", "liner_vacuum_kpa")
WALL_CSV_HEADER = ",".join(
    [*_MIDDLE, *(f"{name}_{place}" for name in _TENSORS for place in ("11", "12", "22")), *_ALL]
)


def truth_at(options: FakeOptions | Mapping[str, Any], time_ns: int) -> Truth:
    """Truth of the targets at a time.

    Args:
        options: options of `FakeGrabber`.
        time_ns: time of a field, or any other time on the same clock.

    Raises:
        ValueError: the options are invalid.
    """
    return _world(options if isinstance(options, FakeOptions) else FakeOptions.read(options)).truth(time_ns)


@lru_cache(maxsize=4)
def _world(options: FakeOptions) -> World:
    return World(options)


def capture_truth(path: Path, of: str = "targets") -> Iterator[str]:
    """CSV lines, the header first: truth at every field of a capture.

    Of `targets`, their positions; the column `visible` is 1 if both views can see the target.

    Of the `wall`, what is under every target. 1 is along the tube and 2 round it; strain is relative to the
    open liner. Of the liner, positions and strain are those of the outer face, see `LinerTruth`; of the
    ellipse, they and the loads that its movement would need are those of the middle surface, see `WallTruth`.

    Of the `load`, that per height along the liner, on the side that faces the cameras, on teat and opposite
    wall, over each of the solved wall's elements.

    Raises:
        CaptureFileError: the file is no capture, or was made by another driver.
        ValueError: the capture shows another scene.
    """
    options, fields = _read_capture(path)
    header, rows = _TABLES["prescribed wall" if of == "wall" and options.scene != "liner" else of]
    yield header
    for n, time_ns in fields:
        for row in rows(options, time_ns):
            yield f"{n},{time_ns},{row}"


def capture_quantities(
    path: Path, flow_stop_kpa: float | None = None, flow_stop_difference_kpa: float | None = None
) -> Iterator[str]:
    """CSV lines, the header first: the liner's quantities, by the names that an analysis has for them.

    Args:
        path: of the capture.
        flow_stop_kpa: contact pressure at which milk just stops flowing; None leaves out what follows.
        flow_stop_difference_kpa: pressure difference across the wall at which it does; likewise.

    Raises:
        CaptureFileError: the file is no capture, or was made by another driver.
        ValueError: the capture shows another scene than the liner.
    """
    options, _ = _read_capture(path)
    if options.scene != "liner":
        raise ValueError(f"scene: {options.scene!r} is not the solved wall 'liner'")
    yield "name,value"
    for name, value in quantities_of(options.liner, flow_stop_kpa, flow_stop_difference_kpa).items():
        yield f"{name},{value:.9g}"


def capture_mat(path: Path, n: int, mat: Mat) -> Iterator[str]:
    """CSV lines, the header first: a mat of pressure sensors on the teat at one field.

    Raises:
        CaptureFileError: the file is no capture, has no such field, or was made by another driver.
        ValueError: the capture shows another scene than a liner on a teat, or such a mat cannot be.
    """
    options, fields = _read_capture(path)
    if options.scene != "liner":
        raise ValueError(f"scene: {options.scene!r} is not the solved wall 'liner'")
    if n not in dict(fields):
        raise CaptureFileError(f"{path} has no field {n}", "choose one of its fields: --field")
    rest_kpa = truth_of_liner(options, dict(fields)[n]).rest_kpa
    return mat_lines(options.liner, rest_kpa, mat, options.seed)


def _target_rows(options: FakeOptions, time_ns: int) -> Iterator[str]:
    truth = truth_at(options, time_ns)
    visible = (truth.visible_left & truth.visible_right).astype(int).tolist()
    for target, (x, y, z), seen in zip(truth.ids.tolist(), truth.xyz_mm.tolist(), visible, strict=True):
        yield f"{target},{x:.6f},{y:.6f},{z:.6f},{seen}"


def _load_rows(options: FakeOptions, time_ns: int) -> Iterator[str]:
    truth = truth_of_liner(options, time_ns)
    for x_mm, load in zip(truth.load_x_mm.tolist(), truth.load_n_per_mm.tolist(), strict=True):
        yield f"{x_mm:.6f},{load:.9g}"


def _liner_rows(options: FakeOptions, time_ns: int) -> Iterator[str]:
    truth = truth_of_liner(options, time_ns)
    table = np.column_stack([truth.face_mm, truth.strain[:, (0, 0, 1), (0, 1, 1)], truth.contact_kpa])
    return _rows(truth.ids, table, truth.rest_kpa, truth.pulsation_kpa, truth.liner_kpa)


def _wall_rows(options: FakeOptions, time_ns: int) -> Iterator[str]:
    truth = truth_of_wall(options, time_ns)
    tensors = [getattr(truth, name)[:, (0, 0, 1), (0, 1, 1)] for name in _TENSORS]
    loads = np.column_stack([truth.pressure_kpa, truth.wall_kpa])
    table = np.hstack([truth.xyz_mm, *tensors, truth.stretch, loads])
    return _rows(truth.ids, table, truth.pulsation_kpa, truth.liner_kpa)


def _rows(ids: NDArray[np.int32], table: Array, *common: float) -> Iterator[str]:
    """Each target's id, its row of the table, and the numbers that all of them have."""
    for target, row in zip(ids.tolist(), table.tolist(), strict=True):
        yield ",".join([str(target), *(f"{value + 0.0:.9g}" for value in (*row, *common))])


_TABLES: Mapping[str, tuple[str, Callable[[FakeOptions, int], Iterator[str]]]] = {
    "targets": (CSV_HEADER, _target_rows),
    "wall": (LINER_CSV_HEADER, _liner_rows),
    "prescribed wall": (WALL_CSV_HEADER, _wall_rows),
    "load": (LOAD_CSV_HEADER, _load_rows),
}


def capture_vacuum_log(
    path: Path, offset_s: float = 0.0, noise_kpa: float = 0.0, rate_hz: float = 1000.0
) -> Iterator[str]:
    """CSV lines, the header first: file of a logger with its own clock, from one cycle before to one after.

    Adding `offset_s` to its times gives seconds since the capture's first field. Where a light is in the
    picture, the logger records its state.

    Raises:
        CaptureFileError: the file is no capture, has no fields, or was made by another driver.
        ValueError: the capture shows a scene without vacuum.
    """
    options, fields = _read_capture(path)
    liner = _pulsating(options)
    if not fields:
        raise CaptureFileError(f"{path} has no fields", "choose a capture with fields")
    period_ns = round(liner.wave.period_s * 1e9)
    start_ns, end_ns = fields[0][1] - period_ns, fields[-1][1] + period_ns
    shifted_s = offset_s + liner.wave.period_s
    light = options.light if options.light.diameter_px > 0 else None
    return vacuum_log(liner, start_ns, end_ns, shifted_s, noise_kpa, rate_hz, options.seed, light)


def _pulsating(options: FakeOptions) -> Pulsating:
    if options.scene not in ("liner", "ellipse"):
        raise ValueError(f"scene: {options.scene!r} has no vacuum; only 'liner' and 'ellipse' have")
    return options.liner if options.scene == "liner" else options.ellipse


def _read_capture(path: Path) -> tuple[FakeOptions, list[tuple[int, int]]]:
    try:
        with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)) as database:
            row = database.execute("SELECT value FROM meta WHERE key = 'device'").fetchone()
            fields = database.execute(
                "SELECT n, time_ns FROM fields WHERE time_ns IS NOT NULL ORDER BY n"
            ).fetchall()
            rearranged = database.execute(
                "SELECT first_n FROM ledger WHERE reason = ? LIMIT 1", (REARRANGED,)
            ).fetchone()
    except sqlite3.Error as error:
        raise CaptureFileError(f"{path}: not a capture file: {error}", "give a sealed .grab file") from error
    if rearranged:
        raise CaptureFileError(
            f"{path}: {REARRANGED} from field {rearranged[0]} on, and only what stood there before was kept",
            "capture again, without changing the stage meanwhile",
        )
    return _options_of(path, json.loads(row[0]) if row else {}), fields


def _options_of(path: Path, device: Mapping[str, Any]) -> FakeOptions:
    check_driver(path, device, "only a simulated scene's truth is known")
    options = FakeOptions.read(device.get("options") or {})
    stage = (device.get("stream") or {}).get("details", {}).get("stage")
    if stage is None:
        return options
    return replace(options, liner=on_stage(options.liner, json.loads(stage), path))


def check_driver(path: Path, device: Mapping[str, Any], hint: str) -> None:
    """Refuses a capture of another driver.

    Raises:
        CaptureFileError: it is one.
    """
    if device.get("driver") != "fake":
        raise CaptureFileError(f"{path}: made with driver {device.get('driver')!r}, not 'fake'", hint)
