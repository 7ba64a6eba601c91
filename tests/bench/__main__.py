"""`python -m tests.bench [accuracy|adjustment|core|live|location|all] [--seconds N] [--write FILE]`."""

import argparse
import platform
from pathlib import Path

from tests.bench import accuracy, adjustment, core, live, location, location_bits

HEADER = """# What was measured

Made by `make bench` and `make soak`; do not edit. Single times on a shared machine are worth little: look at
the ratios, and at what the witness saw of the machine itself.
"""


def main() -> None:
    """Runs what is asked for, prints it, and writes it down where that is asked for."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench", description=__doc__)
    parser.add_argument(
        "what",
        nargs="?",
        default="all",
        choices=["accuracy", "adjustment", "core", "live", "location", "all"],
    )
    parser.add_argument("--seconds", type=float, default=60.0, help="length of the live capture")
    parser.add_argument("--write", type=Path, help="file whose sections are replaced")
    options = parser.parse_args()
    sections: dict[str, str] = {}
    if options.what in ("accuracy", "all"):
        sections["Accuracy against the simulator's truth, mm, RMSE of single fields"] = accuracy.table()
    if options.what in ("adjustment", "all"):
        sections["The bundle adjustment beside scipy.optimize.least_squares"] = adjustment.table()
    if options.what in ("core", "all"):
        sections["From a field to its points"] = core.table()
    if options.what in ("location", "all"):
        sections["Pointing of all locators on the same fields, px"] = location.table()
        sections["Pointing over bits, one capture quantised anew, RMS in px"] = location.table_of_bits()
        sections["Pointing over the targets' size, 8 bit, .5 % noise, RMS in px"] = location.table_of_sizes()
        sections["Pointing at 1 bit: noise and line jitter, RMS in px"] = location_bits.table()
        sections["Pointing at 1 bit: the missing lines, RMS in px"] = location_bits.table_of_lines()
    if options.what in ("live", "all"):
        sections[f"Live, {options.seconds:.0f} s at 50 Hz"] = live.table(options.seconds)
    for title, text in sections.items():
        print(f"## {title}\n\n{text}\n")
    if options.write:
        write(options.write, sections)


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
