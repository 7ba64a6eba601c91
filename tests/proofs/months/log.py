"""A log of what happened, a line of JSON for each fault and each life of the daemon; its summary."""

import json
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

GROWTH_MB, MORE_FILES = 25.0, 12
"""What memory and descriptors of one process may grow by after its first third."""


@dataclass
class Played:
    """A fault; seconds are None where there is nothing to notice, or nothing to recover.

    Attributes:
        was_busy: whether programs waited for a processor meanwhile, so that `problems` are in doubt.
    """

    fault: str
    at_s: float
    noticed_s: float | None = None
    recovered_s: float | None = None
    problems: list[str] = field(default_factory=list)
    was_busy: bool = False


@dataclass
class Lived:
    """A process of the daemon, from its start to its end.

    Attributes:
        fields: of its captures, by what became of them; `captures`: how many files.
        memory_mb, descriptors: at every fault.
        problems: what did not add up, and alarms that stayed.
    """

    end: str
    at_s: float
    captures: int
    fields: dict[str, int]
    memory_mb: list[float]
    descriptors: list[int]
    problems: list[str] = field(default_factory=list)
    was_busy: bool = False


def write_line(file: Path, entry: Played | Lived) -> None:
    """Appends an entry at once: a run that is cut off has its log."""
    with file.open("a", encoding="utf-8") as log:
        log.write(json.dumps({"what": type(entry).__name__, **asdict(entry)}) + "\n")


def read_lines(file: Path) -> list[Played | Lived]:
    """All entries of a log."""
    kinds: dict[str, Any] = {"Played": Played, "Lived": Lived}
    documents = map(json.loads, file.read_text(encoding="utf-8").splitlines())
    return [kinds[document.pop("what")](**document) for document in documents]


def broken(entries: Iterable[Played | Lived], was_busy: bool = False) -> Iterator[str]:
    """Every promise that was not kept, in a sentence; `was_busy`: those that the computer may have broken."""
    for one in entries:
        name = one.fault if isinstance(one, Played) else f"the daemon that was {one.end}"
        problems = [*one.problems, *(_grown(one) if isinstance(one, Lived) else ())]
        if one.was_busy is was_busy:
            yield from (f"{one.at_s:.0f} s, {name}: {problem}" for problem in problems)


def _grown(life: Lived) -> Iterator[str]:
    if (more_mb := _growth(life.memory_mb)) > GROWTH_MB:
        yield f"memory has grown by {more_mb:.0f} MB"
    if (more := _growth(life.descriptors)) > MORE_FILES:
        yield f"{more:.0f} more files are open"


def _growth(values: list[Any]) -> float:
    """Least of the last third, less the most of the third before: what does not come back."""
    third = len(values) // 3
    return float(min(values[-third:]) - max(values[-2 * third : -third])) if third else 0.0


def summary(entries: list[Played | Lived]) -> str:
    """The log as Markdown."""
    lives = [one for one in entries if isinstance(one, Lived)]
    played = [one for one in entries if isinstance(one, Played)]
    fields: Counter[str] = Counter()
    for life in lives:
        fields.update(life.fields)
    lines = [
        f"- {len(played)} faults of {len({one.fault for one in played})} kinds in "
        f"{max((one.at_s for one in entries), default=0) / 60:.0f} minutes, {len(lives)} daemons",
        f"- captures: {sum(life.captures for life in lives)}, with "
        + (
            ", ".join(f"{count} fields {name}" for name, count in sorted(fields.items()) if count)
            or "no fields"
        ),
        f"- memory: {_span([mb for life in lives for mb in life.memory_mb])} MB; "
        f"open files: {_span([count for life in lives for count in life.descriptors])}",
        f"- promises broken: {len(list(broken(entries)))}; in doubt, since programs waited for a processor: "
        f"{len(list(broken(entries, was_busy=True)))}",
        *(f"    - {one}" for one in broken(entries)),
        "",
        "| fault | times | noticed, s (most) | recovered, s (most) |",
        "|---|---|---|---|",
    ]
    return "\n".join([*lines, *_rows(played)]) + "\n"


def _span(values: list[Any]) -> str:
    return f"{min(values):.0f} to {max(values):.0f}" if values else "–"


def _rows(played: list[Played]) -> Iterator[str]:
    for name in sorted({one.fault for one in played}):
        of_it = [one for one in played if one.fault == name]
        noticed, recovered = (
            _most([getattr(one, key) for one in of_it]) for key in ("noticed_s", "recovered_s")
        )
        yield f"| {name} | {len(of_it)} | {noticed} | {recovered} |"


def _most(values: list[float | None]) -> str:
    there = [value for value in values if value is not None]
    return f"{max(there):.2f}" if there else "–"
