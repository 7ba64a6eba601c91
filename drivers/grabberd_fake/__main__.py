"""Prints what is true of the simulated grabber."""

import argparse
import json
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from grabberd.errors import GrabberdError
from grabberd_fake.documents import calibration_document, object_document
from grabberd_fake.options import SCENES, FakeOptions
from grabberd_fake.truth import capture_truth

_EXAMPLES = """examples:
  python -m grabberd_fake calibration > configs/fake.calibration.json
  python -m grabberd_fake calibration --options '{"rig": {"reflections": 1}}'
  python -m grabberd_fake object liner > configs/objects/liner.yaml
  python -m grabberd_fake truth liner.grab > truth.csv"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs a command; returns the exit code."""
    parser = _parser()
    given = parser.parse_args(arguments)
    try:
        for line in _lines(given):
            print(line)
    except (ValueError, GrabberdError) as error:
        parser.exit(2, f"{parser.prog}: {error}\n")
    except BrokenPipeError:  # whoever read along has seen enough
        sys.stderr.close()
    return 0


def _lines(given: argparse.Namespace) -> Iterable[str]:
    if given.command == "truth":
        return capture_truth(given.capture)
    if given.command == "calibration":
        return [json.dumps(calibration_document(FakeOptions.read(given.options)), indent=2)]
    return [object_document(FakeOptions.read({**given.options, "scene": given.scene})).rstrip("\n")]


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
    truth = commands.add_parser("truth", help="true places of all targets at every field of a capture, CSV")
    truth.add_argument("capture", type=Path, help="a .grab file that the simulated grabber made")
    return parser


def _options(text: str) -> dict[str, Any]:
    options = json.loads(text)
    if not isinstance(options, dict):
        raise argparse.ArgumentTypeError(f"not a JSON object: {text}")
    return options


if __name__ == "__main__":
    raise SystemExit(main())
