"""`python -m tests.proofs.faults [--write FILE]`: every fault, and what came of it; fails on a surprise."""

import argparse
import sys
import tempfile
from pathlib import Path

from .failing import failing_machine
from .judging import problems_of
from .playing import FAULTS, play, play_all
from .scenario import all_of
from .table import document


def main() -> int:
    """Plays all of them; the table goes to the terminal, or into a file."""
    parser = argparse.ArgumentParser(description="Every fault, done to the whole daemon.")
    parser.add_argument("--write", type=Path, help="the page of the documentation")
    write = parser.parse_args().write
    scenarios = all_of()
    with tempfile.TemporaryDirectory() as folder:
        suffered = play_all(scenarios, Path(folder) / "grabbers")
        with failing_machine(Path(folder) / "machine") as machine:
            findings = {fault: play(fault, machine) for fault in FAULTS}
    page = document(scenarios, suffered, findings)
    if write is None:
        print(page)
    else:
        write.write_text(page, encoding="utf-8")
    problems = [f"{one.fault}: {said}" for one in scenarios for said in problems_of(one, suffered[one.name])]
    problems += [f"{fault}: {said}" for fault, one in findings.items() for said in one.problems]
    print("\n".join(problems), file=sys.stderr)
    return bool(problems)


if __name__ == "__main__":
    sys.exit(main())
