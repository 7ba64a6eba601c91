"""`python -m tests.house [--write]`: the house counted, and checked against docs/architecture.md.

With `--write`, docs/architecture.md gets the drawing of the rooms, docs/reference/house.md the counts.
"""

import sys

from .drawing import ARCHITECTURE, written
from .hops import stories
from .houses import table as houses_table
from .sizes import cycles, same_names, table, too_long
from .source import ROOT
from .walks import walks

REPORT = ROOT / "docs" / "reference" / "house.md"
HEAD = """# The source in numbers

<!-- made by `make house`; do not edit -->

Files and lines of the program, including its drivers. Hops are the source files in which at least one
function runs; [architecture](../architecture.md) walks through them.
"""


def main() -> int:
    """Counts, compares, and with `--write` writes; the exit status is 1 if a walk-through misses a file."""
    hops = {**stories(), **walks()}
    report = "\n".join(
        [
            HEAD,
            "| hops of | files |",
            "|---|---|",
            *_hops(hops),
            "",
            houses_table(),
            "",
            table(),
            "",
            _names(),
            "",
        ]
    )
    print(report)
    if "--write" in sys.argv:
        REPORT.write_text(report, encoding="utf-8")
        ARCHITECTURE.write_text(written(), encoding="utf-8")
    missing = {story: unnamed(files) for story, files in hops.items()}
    for story, files in missing.items():
        print(
            *(f"docs/architecture.md does not name {file}, which {story} passes" for file in files), sep="\n"
        )
    return 1 if any(missing.values()) else 0


def unnamed(files: list[str]) -> list[str]:
    """Files that docs/architecture.md does not name; chapters of reports stand for their folder."""
    text = ARCHITECTURE.read_text(encoding="utf-8")
    return [file for file in files if f"`{file}`" not in text and "templates/" not in file]


def _hops(hops: dict[str, list[str]]) -> list[str]:
    return [f"| {story} | {len(files)} |" for story, files in hops.items()]


def _names() -> str:
    repeated = same_names()
    return (
        f"Import cycles: {len(cycles())}. Files over 500 lines: {len(too_long())}. "
        f"File names that occur more than once: {len(repeated)}."
    )


if __name__ == "__main__":
    sys.exit(main())
