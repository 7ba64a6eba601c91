"""Every fault in every container, with FFmpeg and without: what must be read, and what is wrong."""

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from proofs.footage.containers import CONTAINERS, Container
from proofs.footage.faults import FAULTS, MUST_BE_READ, NONE, Fault, first_n, frames
from proofs.footage.reading import Camera, Reading, read

ALLOWED_MM = 0.3
"""Largest error beyond that of the same container without a fault, where its codec changes pixels."""
_SHOWN = 100
"""Characters of a remark."""
_WAYS = {True: "with", False: "without"}


@dataclass(frozen=True, slots=True)
class Cell:
    """A fault in a container, read with FFmpeg or without.

    Attributes:
        container, fault, with_ffmpeg: Which.
        reading: What came of it.
        plain: What came of the container without a fault, read in the same way.
    """

    container: Container
    fault: Fault
    with_ffmpeg: bool
    reading: Reading
    plain: Reading

    @property
    def limit_mm(self) -> float:
        """Largest error that is right."""
        return ALLOWED_MM + (self.plain.worst_mm if self.container.is_lossy else 0.0)

    @property
    def is_told(self) -> bool:
        """True if a remark says what would explain an error."""
        return any(words in said for words in self.fault.told for said in self.reading.said)

    @property
    def is_measured(self) -> bool:
        """True if it was read to its end, and shows the camera's targets."""
        return not self.reading.refusal and self.reading.compared > 0

    @property
    def failure(self) -> str:
        """What is wrong with the program; empty if nothing is."""
        is_off = self.reading.worst_mm > self.limit_mm or not self.reading.compared
        if not self.reading.refusal and is_off and not self.is_told:
            return f"silently wrong by {self.reading.worst_mm:.2f} mm"
        if self.must_be_read and not self.is_measured:
            return f"not read: {self.reading.refusal or 'no target was found'}"
        return ""

    @property
    def must_be_read(self) -> bool:
        """True if a refusal would be a failure."""
        needs = self.container.needs_ffmpeg and not self.with_ffmpeg
        return self.fault.name in MUST_BE_READ and not needs

    @property
    def added(self) -> tuple[str, ...]:
        """Remarks that the container without the fault does not have."""
        return tuple(one for one in self.reading.remarks if one not in self.plain.remarks)


@contextmanager
def _ffmpeg(there: bool) -> Iterator[None]:
    path = os.environ["PATH"]
    os.environ["PATH"] = path if there else ""
    try:
        yield
    finally:
        os.environ["PATH"] = path


def cells(camera: Camera, folder: Path, container: Container, faults: Sequence[Fault]) -> Iterator[Cell]:
    """The faults that exist in a container, each with FFmpeg and without; the first is none."""
    plain: dict[bool, Reading] = {}
    for fault in faults:
        if container.lacks(fault):
            continue
        with TemporaryDirectory(dir=folder) as name:
            path = container.write(Path(name), frames(camera.fields, fault), fault)
            truth = {(n - first_n(fault.layout), target): at for (n, target), at in camera.points.items()}
            found: Reading | None = None
            for there in (True, False):
                if found is None or not path.is_dir():  # no program reads a folder
                    with _ffmpeg(there):
                        found = read(path, container.options(fault), truth, Path(name) / "read.grab")
                yield Cell(container, fault, there, found, plain.setdefault(there, found))


def rows(found: Sequence[Cell], container: Container) -> Iterator[str]:
    """The table of a container, in Markdown."""
    by_fault: Mapping[tuple[str, bool], Cell] = {(one.fault.name, one.with_ffmpeg): one for one in found}
    yield "| fault | fields | lost | repeated | largest error, mm | what tells it | without FFmpeg |\n"
    yield "|---|---|---|---|---|---|---|\n"
    for fault in FAULTS:
        if reason := container.lacks(fault):
            yield f"| {fault.name} | – | | | | does not exist: {reason} | |\n"
            continue
        with_it, without = by_fault[fault.name, True], by_fault[fault.name, False]
        counts = " | ".join(_counts(with_it.reading))
        yield f"| {fault.name} | {counts} | {_told(with_it)} | {_other(with_it, without)} |\n"


def _counts(reading: Reading) -> tuple[str, str, str, str]:
    worst = f"{reading.worst_mm:.3f}" if reading.compared else "–"
    return str(reading.fields), str(reading.lost), str(reading.repeated), worst


def _told(cell: Cell) -> str:
    if cell.reading.refusal:
        how = f"ends after {cell.reading.fields} fields" if cell.reading.fields else "refused"
        return f"{how}: {_short(cell.reading.refusal)}"
    said = cell.reading.remarks if cell.fault is NONE else cell.added
    excusing = [one for one in cell.reading.remarks if any(words in one for words in cell.fault.told)]
    return "<br>".join(map(_short, dict.fromkeys([*excusing, *said])))


def _other(with_it: Cell, without: Cell) -> str:
    if _counts(without.reading) == _counts(with_it.reading) and not without.reading.refusal:
        return "the same"
    if without.reading.refusal and not without.reading.fields:
        return _told(without)
    fields, lost, repeated, worst = _counts(without.reading)
    return f"{fields} fields, {lost} lost, {repeated} repeated, {worst} mm; {_told(without)}"


def _short(words: str) -> str:
    plain = " ".join(words.replace("|", "\\|").split())
    return plain if len(plain) <= _SHOWN else plain[:_SHOWN].rsplit(" ", 1)[0] + " …"


def failures(found: Sequence[Cell]) -> list[str]:
    """What is wrong, one line for each cell."""
    return [
        f"{one.container.name}, {one.fault.name}, {_WAYS[one.with_ffmpeg]} FFmpeg: {one.failure}"
        for one in found
        if one.failure
    ]


def names() -> list[tuple[str, str]]:
    """Container and fault of every row."""
    return [(container.name, fault.name) for container in CONTAINERS for fault in FAULTS]
