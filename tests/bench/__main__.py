"""`python -m tests.bench [PART] [--seconds N] [--write FILE]`; a part is a key of `PARTS`, or all of them."""

import argparse
import platform
import sys
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from tests.bench import (
    accuracy,
    adjustment,
    analysis,
    armour,
    averaging,
    calibrated,
    camera,
    capture_file,
    closures,
    content,
    content_found,
    core,
    core_numbers,
    core_progressive,
    demonstration,
    frame_poses,
    goals,
    identification,
    light_clock,
    liner_study,
    live,
    loaded,
    location,
    location_bits,
    memory,
    middle_accuracy,
    page,
    page_open,
    page_tasks,
    points_stream,
    pressure_accuracy,
    pressure_cost,
    pressure_empty,
    pressure_ramp,
    pressure_robustness,
    quantity_sigma,
    reprocess,
    requests,
    several,
    soak,
    study_coverage,
    walls,
)

HEADER = """# What was measured

Made by `make measured` and `make soak`; do not edit. Single times on a shared machine are worth little: look
at the ratios, and at what the witness saw of the machine itself. Other programs: [benchmarks](benchmarks.md).
"""

ARMOUR = "Armour: attacks on the HTTP front"
OPEN = "The page: what it keeps when it stays open"
SOAK = "Soak: 50 Hz, clients that come and go, captures of all kinds"

PARTS: Mapping[str, Mapping[str, Callable[[], str]]] = {
    "accuracy": {"Accuracy against the simulator's truth, mm, RMSE of single fields": accuracy.table},
    "averaging": {"Static fields averaged: leaning discs, uneven mirrors": averaging.table},
    "calibrated": {"Calibrated, then measured: XYZ RMSE in mm (error / σ given)": calibrated.table},
    "capture": {"The capture file: bytes and processor time of a field": capture_file.table},
    "camera": {
        "A digital camera's pictures: what their luma costs": camera.table_of_cost,
        "Progressive pictures compressed: what JPEG costs in accuracy": camera.table_of_accuracy,
    },
    "closures": {"Closures of 20 to 150 ms, against the simulator's truth": closures.table},
    "adjustment": {"The bundle adjustment beside scipy.optimize.least_squares": adjustment.table},
    "analysis": {"From points to tension, against the simulated ellipse's truth": analysis.table},
    "content": {
        "A field taken in: what it costs": content.table,
        "A look at every field: what it finds": content_found.table,
    },
    "targets": {
        "Pointing over the targets' diameter, RMS in x / y, px": location.table_of_diameters,
        "Pointing over the targets' size, 8 bit, .5 % noise, RMS in px": location.table_of_sizes,
    },
    "goals": {"Goals of accuracy and closures: leaning discs, uneven mirrors": goals.table},
    "core": {
        "From a field to its points": core.table,
        "Over the number of targets": core_numbers.table,
    },
    "progressive": {"From a progressive picture to its points": core_progressive.table},
    "empty": {
        "A ramp with the empty liner, and what it is worth": pressure_ramp.table,
        "An empty liner taken for one on a teat": pressure_empty.table,
    },
    "identification": {"Identification of 2 × 108, first field and after a gap": identification.table},
    "study": {"A study: intervals that cover, and false alarms": study_coverage.table},
    "light": {"Clocks related by a light, against the truth": light_clock.table},
    "liners": {"Three liners, four captures each, from an empty folder": liner_study.table},
    "demonstration": {"From an empty folder to a study, one command a step": demonstration.table},
    "location": {
        "Pointing of all locators on the same fields, px": location.table,
        "Pointing over bits, one capture quantised anew, RMS in px": location.table_of_bits,
        "Pointing at 1 bit: noise and line jitter, RMS in px": location_bits.table,
        "Pointing at 1 bit: the missing lines, RMS in px": location_bits.table_of_lines,
    },
    "memory": {"Memory of the daemon and of its process of jobs": memory.table},
    "poses": {"Three poses of the calibration frame against one": frame_poses.table},
    "page": {
        "The page: what it weighs, how soon it is seen, what it costs": page.table,
        "The page: what it keeps when every panel is shown again and again": page_open.table,
    },
    "pressure": {
        "Contact pressure on solved walls, kPa: RMS / σ (χ²)": pressure_accuracy.table,
        "Contact pressure where something is off, kPa": pressure_robustness.table,
        "Curvature and strain of the middle surface on solved walls": middle_accuracy.table,
        "What an analysis with the pressure costs": pressure_cost.table,
    },
    "quantities": {
        "Quantities: scatter by what is each capture's own, and by what is given": quantity_sigma.table
    },
    "reprocess": {"An archive measured again": reprocess.table},
    "requests": {
        "Requests: what each costs in processor time": requests.table,
        "Points stream: how late its fields are, and what they cost": points_stream.table,
    },
    "tasks": {"The page: everyday tasks, steps and seconds": page_tasks.table},
    "walls": {"The simulated walls: buckling, touch, and the load on the teat": walls.table},
}
"""Tables by the titles of their sections, without those of the running daemon."""


def main() -> None:
    """Runs what is asked for, prints it, and writes it down where that is asked for."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench", description=__doc__)
    parser.add_argument(
        "what",
        nargs="?",
        default="all",
        choices=[*PARTS, "live", "several", "soak", "loaded", "armour", "open", "all"],
    )
    parser.add_argument(
        "--seconds", type=float, default=60.0, help="length of a live capture, soak, attack or open page"
    )
    parser.add_argument("--write", type=Path, help="file whose sections are replaced")
    parser.add_argument("--seed", type=int, default=soak.SEED, help="who comes when in the soak")
    parser.add_argument("--load", type=int, default=4, help="number of busy loops")
    parser.add_argument("--devices", type=int, default=1, help="number of grabbers beside the busy loops")
    options = parser.parse_args()
    if options.what == "loaded":
        sys.exit(_loaded(options))
    if options.what == "soak":
        sys.exit(_soak(options.seconds, options.seed, options.write))
    for title, table in {**_tables(options.what), **_lasting(options.what, options.seconds)}.items():
        text = table()
        print(f"## {title}\n\n{text}\n")
        if options.write:
            write(options.write, {title: text})


def _soak(seconds: float, seed: int, file: Path | None) -> int:
    """Shows it and writes it down; 1 where a promise is broken."""
    done = soak.soak(seconds, seed)
    print(f"## {SOAK}\n\n{done.table()}\n")
    if file:
        write(file, {SOAK: done.table()})
    return int(bool(done.broken))


def _loaded(options: argparse.Namespace) -> int:
    """Shows it and writes it down; 1 where fields are missing."""
    done = loaded.loaded(options.seconds, options.load, options.devices)
    title = f"Soak: {options.devices} at 50 Hz beside {options.load} busy loops"
    print(f"## {title}\n\n{done.table()}\n")
    if options.write:
        write(options.write, {title: done.table()})
    return int(done.missing > 0)


def _lasting(what: str, seconds: float) -> Mapping[str, Callable[[], str]]:
    """Tables of what is watched for a while."""
    asked = {
        f"Live, {seconds:.0f} s at 50 Hz": (("live", "all"), live.table),
        f"Several: four devices at 50 Hz, {seconds:.0f} s": (("several", "all"), several.table),
        ARMOUR: (("armour",), armour.table),
        OPEN: (("open",), page_open.table_of_open),
    }
    return {title: partial(table, seconds) for title, (names, table) in asked.items() if what in names}


def _tables(what: str) -> Mapping[str, Callable[[], str]]:
    if what == "all":
        return {title: table for part in PARTS.values() for title, table in part.items()}
    return PARTS.get(what, {})


def write(file: Path, sections: dict[str, str]) -> None:
    """Replaces these sections of a Markdown file and leaves its others."""
    kept = _sections(file.read_text()) if file.exists() else {}
    machine = f"{platform.machine()}, Python {platform.python_version()}"
    kept |= {title: f"On {machine}.\n\n{text}" for title, text in sections.items()}
    file.write_text(HEADER + "".join(f"\n## {title}\n\n{text}\n" for title, text in kept.items()))


def _sections(text: str) -> dict[str, str]:
    parts = text.split("\n## ")[1:]
    return {part.split("\n", 1)[0]: part.split("\n", 1)[1].strip() for part in parts}


if __name__ == "__main__":
    main()
