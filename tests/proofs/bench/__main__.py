"""`python -m tests.proofs.bench [PART] [--seconds N] [--write FILE]`; a part is one of `PARTS`, or `all`."""

import argparse
import platform
import sys
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from tests.proofs.bench import (
    accuracy,
    adjustment,
    analysis,
    analysis_cost,
    armour,
    averaging,
    calibrated,
    calibration_sigma,
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
    hostile_folder,
    identification,
    light_clock,
    liner_study,
    live,
    load_accuracy,
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
    single_fields,
    soak,
    study_coverage,
    visibility,
    walls,
)

HEADER = """# Measured accuracy and speed

Made by `make measured` and `make soak`; do not edit. Absolute times on a shared machine mean little: compare
the ratios, and check the rows of the witness, a process that records how busy the machine itself was. For
other programs see [benchmarks](benchmarks.md).
"""

ARMOUR = "Attacks on the HTTP server"
HOSTILE = "A folder of captures that are made to be heavy"
OPEN = "The page: memory when it stays open"
SOAK = "Soak test: 50 Hz, clients that come and go, captures of all kinds"

PARTS: Mapping[str, Mapping[str, Callable[[], str]]] = {
    "accuracy": {"Accuracy against the simulator's truth, mm, RMSE of single fields": accuracy.table},
    "averaging": {"Averages of static fields: leaning discs, uneven mirrors": averaging.table},
    "calibrated": {"Accuracy after calibration: XYZ RMSE in mm (error / stated σ)": calibrated.table},
    "calibrations": {"Calibrations of twelve rigs set aside": calibration_sigma.table},
    "capture": {"Capture file: bytes and processor time per field": capture_file.table},
    "camera": {
        "Digital cameras: processor time of the luma conversion": camera.table_of_cost,
        "Compressed progressive pictures: accuracy lost to JPEG": camera.table_of_accuracy,
    },
    "closures": {
        "Fast closures (20 to 150 ms) compared with the simulator's truth": partial(closures.table, 2),
        "Fast closures (20 to 150 ms) behind one mirror a view": partial(closures.table, 1),
    },
    "adjustment": {"Bundle adjustment compared with scipy.optimize.least_squares": adjustment.table},
    "analysis": {"From points to tension, compared with the simulated ellipse's truth": analysis.table},
    "analyse": {"The command `grabberd analyse`: processor time and memory": analysis_cost.table_of_commands},
    "content": {
        "Field intake: processor time": content.table,
        "Content checks of every field: detection rates and false alarms": content_found.table,
    },
    "targets": {
        "Pointing by target diameter, RMS in x / y, px": location.table_of_diameters,
        "Pointing by target size, 8 bit, .5 % noise, RMS in px": location.table_of_sizes,
    },
    "goals": {"Accuracy goals: leaning discs, uneven mirrors, fast closures": goals.table},
    "core": {
        "From a field to its points: processor time": core.table,
        "Processor time by number of targets": core_numbers.table,
    },
    "progressive": {"From a progressive picture to its points: processor time": core_progressive.table},
    "empty": {
        "A ramp with the empty liner, and what it is worth": pressure_ramp.table,
        "False pressure when an empty liner is analysed as one on a teat": pressure_empty.table,
    },
    "identification": {
        "Identification of 2 × 108 targets, in the first field and after a gap": identification.table
    },
    "single": {"Single fields at 1 and 8 bits, drawn by another renderer": single_fields.table},
    "study": {"Studies: coverage of intervals, and false alarms": study_coverage.table},
    "light": {"Clock alignment by a light, compared with the truth": light_clock.table},
    "liners": {"Three liners, four captures each: quantities compared with the truth": liner_study.table},
    "demonstration": {
        "A complete liner study from the command line, compared with the truth": demonstration.table
    },
    "load": {
        "Compression and load on closed walls set aside": load_accuracy.table,
    },
    "location": {
        "Pointing of all locators on the same fields, RMS in px": location.table,
        "Pointing by bits, one capture requantised, RMS in px": location.table_of_bits,
        "Pointing at 1 bit: noise and line jitter, RMS in px": location_bits.table,
        "Pointing at 1 bit: the missing lines, RMS in px": location_bits.table_of_lines,
    },
    "memory": {"Memory of the daemon and of its job process": memory.table},
    "poses": {"Three poses of the calibration frame compared with one": frame_poses.table},
    "page": {
        "The page: size, load time and cost": page.table,
        "The page: memory when every panel is shown again and again": page_open.table,
    },
    "pressure": {
        "Contact pressure on solved walls, kPa: RMS / σ (χ²)": pressure_accuracy.table,
        "Contact pressure with wrong inputs, kPa": pressure_robustness.table,
        "Curvature and strain of the middle surface on solved walls": middle_accuracy.table,
        "Analysis with pressure: processor time and memory": pressure_cost.table,
    },
    "quantities": {
        "Quantities: scatter from each capture's own errors and from the inputs": quantity_sigma.table
    },
    "reprocess": {"Re-measuring an archive: throughput and memory": reprocess.table},
    "requests": {
        "Requests: processor time of each": requests.table,
        "Points stream: latency and processor time": points_stream.table,
    },
    "tasks": {"The page: steps and seconds of everyday tasks": page_tasks.table},
    "visibility": {"Closing walls of six to nine columns, drawn by another renderer": visibility.table},
    "walls": {"Simulated walls: buckling, touch point, and load on the teat": walls.table},
}
"""Tables by the titles of their sections, without those of the running daemon."""


def main() -> None:
    """Runs what is asked for, prints it, and writes it down where that is asked for."""
    parser = argparse.ArgumentParser(prog="python -m tests.proofs.bench", description=__doc__)
    parser.add_argument(
        "what",
        nargs="?",
        default="all",
        choices=[*PARTS, "live", "several", "soak", "loaded", "armour", "hostile", "open", "all"],
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
    title = f"Soak test: {options.devices} at 50 Hz beside {options.load} busy loops"
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
        HOSTILE: (("hostile",), hostile_folder.table),
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
