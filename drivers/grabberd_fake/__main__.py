"""Prints calibration, object models and truth of the simulated grabber, audits captures, sets its stage."""

import argparse
import json
import sys
import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from grabberd.bounded_documents import yaml_text
from grabberd.errors import GrabberdError
from grabberd_fake.audit import audit
from grabberd_fake.documents import calibration_document, object_document
from grabberd_fake.options import SCENES, FakeOptions
from grabberd_fake.stage import MILKING, NO_VACUUM, ramp, write_stage
from grabberd_fake.truth import capture_quantities, capture_truth, capture_vacuum_log
from grabberd_fake.wall_states import wall_names

_EXAMPLES = """examples:
  python -m grabberd_fake calibration > configs/fake.calibration.json
  python -m grabberd_fake calibration --options '{"rig": {"reflections": 1}}'
  python -m grabberd_fake object liner > configs/objects/liner.yaml
  python -m grabberd_fake object ellipse > configs/objects/ellipse.yaml
  python -m grabberd_fake truth liner.grab > truth.csv
  python -m grabberd_fake truth liner.grab --of wall > wall.csv
  python -m grabberd_fake truth liner.grab --of load > load.csv
  python -m grabberd_fake truth liner.grab --of quantities
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
        return capture_quantities(given.capture, given.flow_stop_kpa)
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
        choices=("targets", "wall", "load", "quantities", "vacuum"),
        default="targets",
        help="the targets' places, the wall's strain and pressure, its load, the liner's quantities, or the "
        "readings of a vacuum logger",
    )
    truth.add_argument(
        "--offset-s", type=float, default=0.0, help="of vacuum: seconds since the first field - logger's time"
    )
    truth.add_argument(
        "--flow-stop-kpa",
        type=float,
        help="of quantities: contact pressure at which milk stops flowing, for the overpressure",
    )
    truth.add_argument("--noise-kpa", type=float, default=0.0, help="of vacuum: σ of each reading")
    truth.add_argument("--rate-hz", type=float, default=1000.0, help="of vacuum: readings a second")


def _options(text: str) -> dict[str, Any]:
    options = json.loads(text)
    if not isinstance(options, dict):
        raise argparse.ArgumentTypeError(f"not a JSON object: {text}")
    return options


if __name__ == "__main__":
    raise SystemExit(main())
