"""`python -m tests.house [--write]`: the house counted, and what its stories pass.

With `--write`, docs/architecture.md gets the drawing of the rooms, docs/reference/house.md all else.
"""

import ast
import re
import sys

from .drawing import ARCHITECTURE, written
from .hops import stories
from .houses import table as houses_table
from .sizes import cycles, same_names, table, too_long
from .source import ROOT, modules, relative, tree
from .walks import walks

REPORT = ROOT / "docs" / "reference" / "house.md"
HEAD = """# The source in numbers

<!-- made by `make house`; do not edit -->

Files and lines of the program, including its drivers. Hops are the source files in which at least one
function runs, traced in the running program; [architecture](../architecture.md) tells what happens in them.
"""

SENTENCE = re.compile(r"(?<=\.) ")


def main() -> None:
    """Counts and traces, and with `--write` writes."""
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
            *(line for story, files in hops.items() for line in _passed(story, files)),
        ]
    )
    print(report)
    if "--write" in sys.argv:
        REPORT.write_text(report, encoding="utf-8")
        ARCHITECTURE.write_text(written(), encoding="utf-8")


def _passed(story: str, files: list[str]) -> list[str]:
    """A story's files by room, each with the first sentence about it."""
    rooms: dict[str, list[str]] = {}
    for file in files:
        rooms.setdefault(file.rpartition("/")[0] or ".", []).append(file)
    lines = [f"## {story[0].upper()}{story[1:]}", ""]
    for room, some in rooms.items():
        lines += [f"`{room}`", "", *(f"- `{one.rpartition('/')[2]}`{_about(one)}" for one in some), ""]
    return lines


def _about(file: str) -> str:
    """The first sentence of a module's docstring; nothing for a template, which has none."""
    path = next((path for path in modules().values() if relative(path) == file), None)
    words = "" if path is None else " ".join((ast.get_docstring(tree(path)) or "").split())
    return f": {re.split(SENTENCE, words)[0].rstrip('.')}" if words else ""


def _hops(hops: dict[str, list[str]]) -> list[str]:
    return [f"| {story} | {len(files)} |" for story, files in hops.items()]


def _names() -> str:
    repeated = same_names()
    return (
        f"Import cycles: {len(cycles())}. Files over 500 lines: {len(too_long())}. "
        f"File names that occur more than once: {len(repeated)}."
    )


if __name__ == "__main__":
    main()
