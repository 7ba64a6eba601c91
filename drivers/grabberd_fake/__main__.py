"""Prints calibration, object models and truth of the simulated grabber, audits captures, sets its stage.

Audit of a capture: its account of fields, compared with the numbers in the pictures.

Every picture of the simulated grabber has the camera's own number in its corner, and camera field n is
exposed at n periods of the clock. So each number and time in a capture file can be checked, and a wrong
one is a lie, unless the file says of this very field that its number is uncertain by as much, or of one
before it that the numbers from there on are off by as many.
"""

import argparse
import json
import math
import re
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from grabberd.archive.capture.reader import CaptureReader
from grabberd.bounded_documents import yaml_text
from grabberd.core.field import unpack
from grabberd.errors import GrabberdError
from grabberd_fake.faults import PERIOD_NS
from grabberd_fake.optics import COLUMNS, HALF, LINES, Array, View, build_views
from grabberd_fake.options import SCENES, FakeOptions
from grabberd_fake.stage import MILKING, NO_VACUUM, ramp, write_stage
from grabberd_fake.stamp import read_stamp
from grabberd_fake.teat_mat import Mat
from grabberd_fake.truth import (
    capture_mat,
    capture_quantities,
    capture_truth,
    capture_vacuum_log,
    check_driver,
)
from grabberd_fake.wall_states import wall_names
from grabberd_fake.world import build_scene

_UNCERTAIN = re.compile(r"number uncertain by up to (\d+)")
_OFF = re.compile(r"numbers from here on are (\d+) too (high|low)")
_AT_THE_BEGIN = 1
"""Fields by which the begin may be off: where it lies between two of them, times decide, and they jitter."""


class Judged(NamedTuple):
    """A recorded field whose picture has a legible number.

    Attributes:
        n: Its number in the file.
        camera_n: Its number in the picture.
        time_ns: Its time in the file.
        reason: Its reason in the file, or None.
    """

    n: int
    camera_n: int
    time_ns: int
    reason: str | None


class Audit(NamedTuple):
    """Result of an audit.

    Attributes:
        fields: Number of fields in the account.
        judged: Number of those whose picture tells their number.
        uncertain: Number of those that the file says are uncertain.
        lies: What is wrong, in sentences.
    """

    fields: int
    judged: int
    uncertain: int
    lies: tuple[str, ...]


def audit(path: Path) -> Audit:
    """Audits a capture file.

    Raises:
        CaptureFileError: It cannot be read, or was not made by the simulated grabber.
    """
    with CaptureReader(path) as reader:
        meta, ledger = reader.meta, reader.ledger
        period_ns = round(1e9 / meta.rate_hz)
        check_driver(path, meta.device, "only the simulated grabber's pictures tell their number")
        judged = [
            Judged(recorded.numbered.n, stamp.number, recorded.numbered.time_ns, recorded.reason)
            for recorded in reader.fields()
            if (stamp := read_stamp(unpack(recorded.numbered.packed).luma)) is not None
        ]
    begin_n = None
    if meta.device.get("stream", {}).get("live"):
        begin_ns = meta.start_ns - meta.extra.get("trigger", {}).get("n", 0) * period_ns
        begin_n = math.ceil(begin_ns / period_ns)
    uncertain = sum(_stated(one.reason) > 0 for one in judged)
    too_high = [(event.n, _too_high_by(event.reason)) for event in ledger.events]
    return Audit(ledger.total, len(judged), uncertain, tuple(lies_of(judged, begin_n, too_high, period_ns)))


def lies_of(
    fields: Iterable[Judged],
    begin_n: int | None,
    too_high: Sequence[tuple[int, int]] = (),
    period_ns: int = PERIOD_NS,
) -> Iterator[str]:
    """Sentences about fields whose number or time is another one than the camera's.

    Args:
        fields: In the order of the file.
        begin_n: Camera field that the capture was to begin with; None where nobody knows.
        too_high: Fields from which on the file says that numbers are too high, and by how many.
        period_ns: Time from field to field of the camera.
    """
    fields = list(fields)

    def places(one: Judged) -> int:
        return one.n - one.camera_n - sum(by for n, by in too_high if n <= one.n)

    certain = next((one for one in fields if not _stated(one.reason)), fields[0] if fields else None)
    known = 0 if certain is None else -places(certain)
    if begin_n is not None and abs(known - begin_n) > _AT_THE_BEGIN:
        known = begin_n
    for one in fields:
        stated = _stated(one.reason)
        off = places(one) + known
        if abs(off) > stated:
            yield f"field {one.n} is the camera's {one.camera_n}, {abs(off)} places from where it is entered"
        late_ns = one.time_ns - one.camera_n * period_ns
        if begin_n is not None and abs(late_ns) > period_ns * (1 + stated):
            yield f"field {one.n} was exposed {-late_ns / 1e6:+.0f} ms from the time that is entered"


def _too_high_by(reason: str) -> int:
    found = _OFF.search(reason)
    return 0 if found is None else int(found[1]) * (1 if found[2] == "high" else -1)


def _stated(reason: str | None) -> int:
    found = _UNCERTAIN.search(reason or "")
    return int(found[1]) if found else 0


CREATED_UTC = "2026-01-01T00:00:00Z"
# The nominal shape of a liner is known far less well than a certified object.
_SIGMA_MM = {"liner": 0.3, "ellipse": 0.3}
_CERTIFIED_SIGMA_MM = 0.01


def calibration_document(options: FakeOptions) -> dict[str, Any]:
    """The exact calibration of the simulated rig, without the mirrors' local errors.

    A virtual camera is the real one reflected in its half's mirrors, from the camera outwards.
    """
    left, right = build_views(options)
    return {
        "schema": "grabberd/calibration/1",
        "id": f"fake-{options.rig.seed}-{options.rig.reflections}",
        "created_utc": CREATED_UTC,
        "source": "exact optics of the simulated grabber",
        "image": {"columns": COLUMNS, "lines": LINES},
        "views": {view.name: _view_document(view) for view in (left, right)},
        "covariance": None,
        "sigma0_px": None,
        "glass": None,
        "details": {"mirror_error_px": options.rig.mirror_error_px, "image_model": {"disc_centres": True}},
    }


def _view_document(view: View) -> dict[str, Any]:
    camera, axes = view.camera.options, view.axes()
    handedness = 1 if len(view.mirrors) % 2 == 0 else -1
    axes[0] *= handedness  # axes = diag(handedness, 1, 1) · R
    omega, phi, kappa = _angles(axes)
    center = view.center_mm()
    return {
        "first_column": view.first_column,
        "end_column": view.first_column + HALF,
        "pixel_x_mm": camera.pixel_x_mm,
        "pixel_y_mm": camera.pixel_y_mm,
        "handedness": handedness,
        "f_mm": camera.f_mm,
        "x0_px": camera.x0_px,
        "y0_px": camera.y0_px + view.line_offset,
        "omega_rad": omega,
        "phi_rad": phi,
        "kappa_rad": kappa,
        "X0_mm": float(center[0]),
        "Y0_mm": float(center[1]),
        "Z0_mm": float(center[2]),
        "b": [0.0, 0.0, *camera.radial, *camera.decentering, 0.0, 0.0],
    }


def _angles(rotation: Array) -> tuple[float, float, float]:
    """ω, φ, κ of R = Rκ·Rφ·Rω, whose matrices turn the axes counterclockwise; φ stays far from ±π/2."""
    phi = math.asin(rotation[2, 0])
    return math.atan2(-rotation[2, 1], rotation[2, 2]), phi, math.atan2(-rotation[1, 0], rotation[0, 0])


def object_document(options: FakeOptions) -> str:
    """The scene's object model as YAML; for the liner, its mounted state without a pressure difference."""
    scene = build_scene(options)
    # Adding zero turns −0.0 into 0.0, which would otherwise be written with its sign.
    nominal = scene.nominal().xyz_mm.round(4) + 0.0
    targets = zip(scene.ids, nominal, scene.row, scene.column, strict=True)
    head = [
        f"name: {options.scene}",
        f"target_diameter_mm: {options.target_diameter_mm:g}",
        f"sigma_mm: {_SIGMA_MM.get(options.scene, _CERTIFIED_SIGMA_MM):g}",
        "targets:",
    ]
    lines = [
        f"  - {{id: {number}, x_mm: {x:.4f}, y_mm: {y:.4f}, z_mm: {z:.4f}, row: {row}, column: {column}}}"
        for number, (x, y, z), row, column in targets
    ]
    return "\n".join(head + lines) + "\n"


_EXAMPLES = """examples:
  python -m grabberd_fake calibration > configs/fake.calibration.json
  python -m grabberd_fake calibration --options '{"rig": {"reflections": 1}}'
  python -m grabberd_fake object liner > configs/objects/liner.yaml
  python -m grabberd_fake object ellipse > configs/objects/ellipse.yaml
  python -m grabberd_fake truth liner.grab > truth.csv
  python -m grabberd_fake truth liner.grab --of wall > wall.csv
  python -m grabberd_fake truth liner.grab --of load > load.csv
  python -m grabberd_fake truth liner.grab --of quantities
  python -m grabberd_fake truth liner.grab --of mat --field 40 --noise-kpa 1 > mat.csv
  python -m grabberd_fake audit liner.grab
  python -m grabberd_fake stage stage.yaml --wall thin-empty --ramp
  python -m grabberd_fake truth liner.grab --of vacuum --offset-s 0.37 --noise-kpa 0.1 > vacuum.csv"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs a command; returns the exit code."""
    parser = _parser()
    given = parser.parse_args(arguments)
    try:
        if given.command == "audit":
            return _audit(given.capture)
        for line in _lines(given):
            print(line)
    except (ValueError, GrabberdError) as error:
        parser.exit(2, f"{parser.prog}: {error}\n")
    except BrokenPipeError:  # `| head` has seen enough; a closed stderr keeps Python's own complaint quiet
        sys.stderr.close()
    return 0


def _lines(given: argparse.Namespace) -> Iterable[str]:
    if given.command == "truth":
        return _truth_lines(given)
    if given.command == "stage":
        return [yaml_text(_stage(given)).rstrip("\n")]
    if given.command == "calibration":
        return [json.dumps(calibration_document(FakeOptions.read(given.options)), indent=2)]
    return [object_document(FakeOptions.read({**given.options, "scene": given.scene})).rstrip("\n")]


def _stage(given: argparse.Namespace) -> dict[str, Any]:
    """Rearranges the stage, and returns what stands there now."""
    vacuums = {None: {}, "none": NO_VACUUM, "ramp": ramp(time.monotonic()), "milking": MILKING}
    return write_stage(given.file, {**vacuums[given.vacuum], **({"wall": given.wall} if given.wall else {})})


def _audit(path: Path) -> int:
    """Prints what an audit found; 1 if anything is wrong."""
    found = audit(path)
    for lie in found.lies:
        print(lie)
    uncertain = f", {found.uncertain} said to be uncertain" if found.uncertain else ""
    print(f"{found.fields} fields, {found.judged} with a number{uncertain}: {len(found.lies)} lies")
    return 1 if found.lies else 0


def _truth_lines(given: argparse.Namespace) -> Iterable[str]:
    if given.of == "quantities":
        return capture_quantities(given.capture, given.flow_stop_kpa, given.flow_stop_difference_kpa)
    if given.of == "mat":
        mat = Mat(given.cell_mm, given.noise_kpa, given.turned_deg)
        return capture_mat(given.capture, given.field, mat)
    if given.of == "vacuum":
        return capture_vacuum_log(given.capture, given.offset_s, given.noise_kpa, given.rate_hz)
    return capture_truth(given.capture, given.of)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        "python -m grabberd_fake",
        description=__doc__,
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(dest="command", required=True)
    calibration = commands.add_parser(
        "calibration", help="the exact calibration document of its optics, JSON"
    )
    scene = commands.add_parser("object", help="the object model of a scene, YAML")
    scene.add_argument("scene", choices=SCENES)
    for command in (calibration, scene):
        command.add_argument("--options", type=_options, default={}, help="the driver's options, JSON")
    checked = commands.add_parser(
        "audit", help="compare a capture's account with the numbers in its pictures"
    )
    checked.add_argument("capture", type=Path, help="a .grab file that the simulated grabber made")
    _add_stage(commands.add_parser("stage", help="rearrange what a running simulated grabber looks at"))
    _add_truth(commands.add_parser("truth", help="the truth at every field of a capture, CSV"))
    return parser


def _add_stage(stage: argparse.ArgumentParser) -> None:
    stage.add_argument("file", type=Path, help="file that the option `stage` of grabber and logger names")
    stage.add_argument("--wall", choices=wall_names(), metavar="DESIGN-TEAT", help="liner and teat")
    vacuum = stage.add_mutually_exclusive_group()
    for name, text in (
        ("none", "switch both vacuums off"),
        ("ramp", "let the pressure difference rise from 0 to 20 kPa in 50 s, ten seconds from now"),
        ("milking", "let the machine milk, as configured"),
    ):
        option = "--no-vacuum" if name == "none" else f"--{name}"
        vacuum.add_argument(option, dest="vacuum", action="store_const", const=name, help=text)


def _add_truth(truth: argparse.ArgumentParser) -> None:
    truth.add_argument("capture", type=Path, help="a .grab file that the simulated grabber made")
    truth.add_argument(
        "--of",
        choices=("targets", "wall", "load", "quantities", "vacuum", "mat"),
        default="targets",
        help="the targets' places, the wall's strain and pressure, its load, the liner's quantities, the "
        "readings of a vacuum logger, or those of a mat of pressure sensors on the teat",
    )
    truth.add_argument(
        "--offset-s", type=float, default=0.0, help="of vacuum: seconds since the first field - logger's time"
    )
    truth.add_argument(
        "--flow-stop-kpa",
        type=float,
        help="of quantities: contact pressure at which milk stops flowing, for the overpressure by the map",
    )
    truth.add_argument(
        "--flow-stop-difference-kpa",
        type=float,
        help="of quantities: pressure difference at which milk stops flowing, for the derived overpressure",
    )
    truth.add_argument("--noise-kpa", type=float, default=0.0, help="of vacuum and mat: σ of each reading")
    truth.add_argument("--field", type=int, default=0, help="of mat: number of the field")
    truth.add_argument("--cell-mm", type=float, default=5.0, help="of mat: width of a cell")
    truth.add_argument("--turned-deg", type=float, default=0.0, help="of mat: how far it lies turned")
    truth.add_argument("--rate-hz", type=float, default=1000.0, help="of vacuum: readings a second")


def _options(text: str) -> dict[str, Any]:
    options = json.loads(text)
    if not isinstance(options, dict):
        raise argparse.ArgumentTypeError(f"not a JSON object: {text}")
    return options


if __name__ == "__main__":
    raise SystemExit(main())
