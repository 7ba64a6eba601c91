"""Which captures are to be measured again, and which are not, and why: before any work is done."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from glob import glob
from pathlib import Path
from typing import NamedTuple

from grabberd import __version__
from grabberd.errors import CaptureFileError, Conflict, GrabberdError, InputError
from grabberd.service.reprocess.reprocess_capture import Asked, Order
from grabberd.storage import CaptureReader
from grabberd.storage.capture.schema import DAMAGED, PART, SUFFIX
from grabberd.storage.export.dataset import DataSet, Place
from grabberd.storage.export.dataset_file import read_about

LISTED = 3


class Refusal(NamedTuple):
    """A capture that could not be measured."""

    capture: Path
    problem: str
    hint: str


class LeftOut(NamedTuple):
    """A file that was passed over, as it should be."""

    capture: Path
    reason: str


@dataclass(slots=True)
class Plan:
    """What is to be done: `unchanged` counts what is done already."""

    orders: list[Order] = field(default_factory=list)
    unchanged: int = 0
    refused: list[Refusal] = field(default_factory=list)
    left_out: list[LeftOut] = field(default_factory=list)


class Found(NamedTuple):
    """Sealed captures, and files that are passed over."""

    captures: list[Path]
    left_out: list[LeftOut]


def find_captures(sources: Iterable[str]) -> Found:
    """The captures in folders and what is below them, of patterns such as `*/2026-03-*.grab`, and by name.

    Raises:
        InputError: a source is not there, or there is no capture at all.
    """
    sources = list(sources)
    paths = sorted({path.resolve() for source in sources for path in _files(source)})
    left_out = [LeftOut(path, reason) for path in paths if (reason := _passed_over(path))]
    captures = [path for path in paths if path.name.endswith(SUFFIX) and not _passed_over(path)]
    if not captures:
        also = f"; {left_out[0].capture.name} is left out: {left_out[0].reason}" if left_out else ""
        raise InputError(
            f"no sealed captures in {', '.join(sources)}{also}",
            f"name folders or files that end with {SUFFIX}",
        )
    return Found(captures, left_out)


def _files(source: str) -> Iterator[Path]:
    path = Path(source)
    if path.is_dir():
        yield from (one for end in (SUFFIX, SUFFIX + PART) for one in path.rglob(f"*{end}") if one.is_file())
    elif path.is_file():
        yield path
    elif found := glob(source, recursive=True):
        for one in found:
            yield from _files(one)
    else:
        hint = "check the name; put patterns into quotes, and ** in them goes down into folders"
        raise InputError(f"there is no {source}", hint)


def _passed_over(path: Path) -> str | None:
    if path.name.endswith(SUFFIX + PART):
        return "is not sealed: it is still being recorded, or its daemon has to be started once"
    if path.parent.name == DAMAGED:
        return "was set aside as damaged"
    return None


class Planner:
    """Compares captures with what is in the data set.

    Args:
        dataset: where the points go; `scratch`: its folder for what is not finished.
        asked: what to measure with.
        barn: of captures whose site has none.
        replace: whether points of another calibration make room for these.
    """

    def __init__(
        self, dataset: DataSet, scratch: Path, asked: Asked, *, barn: str | None, replace: bool
    ) -> None:
        self._dataset = dataset
        self._scratch = scratch
        self._asked = asked
        self._barn = barn
        self._replace = replace
        self._taken: dict[tuple[str, str], tuple[Place, Path | None]] = {
            (place.barn, place.capture): (place, None) for place in dataset.places()
        }
        self._others: list[str] = []

    def plan(self, found: Found) -> Plan:
        """What to do with each of them.

        Raises:
            Conflict: there are points in the data set that were measured with something else.
        """
        plan = Plan(left_out=list(found.left_out))
        for number, path in enumerate(found.captures):
            try:
                self._enter(path, self._scratch / f"{number}{PART}", plan)
            except GrabberdError as error:
                plan.refused.append(Refusal(path, error.message, error.hint))
        if self._others:
            raise self._conflict()
        return plan

    def _enter(self, path: Path, part: Path, plan: Plan) -> None:
        with CaptureReader(path) as reader:
            place, span = self._place(reader), reader.field_span
        if reason := self._copy_of(place, path):
            plan.left_out.append(LeftOut(path, reason))
            return
        target = self._dataset.directory / place.path
        if target.exists() and self._is_done(path, target, place.barn):
            plan.unchanged += 1
            return
        documents = self._dataset.made_with
        plan.orders.append(Order(path, place.barn, target, part, documents, self._asked, span))

    def _place(self, reader: CaptureReader) -> Place:
        barn = str(reader.meta.site.get("barn") or self._barn or "").strip()
        if not barn:
            raise InputError(
                f"capture {reader.meta.id} does not say which barn it is from", "name it with --barn NAME"
            )
        try:
            return Place.of(reader.meta, barn)
        except ValueError as error:
            raise CaptureFileError(f"{reader.path}: its time is none: {error}", "keep it aside") from error

    def _copy_of(self, place: Place, path: Path) -> str | None:
        """Why a file is passed over that another one is the same capture as.

        Raises:
            Conflict: it is a different capture of the same id.
        """
        other, other_path = self._taken.setdefault((place.barn, place.capture), (place, path))
        if other != place:
            where = other_path or self._dataset.directory / other.path
            raise Conflict(
                f"another capture of barn {place.barn} is called {place.capture} as well: {where}",
                "measure one of them into another --out, or with another --barn",
            )
        self._taken[place.barn, place.capture] = (place, other_path or path)
        return None if other_path in {None, path} else f"is the same capture as {other_path}"

    def _is_done(self, path: Path, target: Path, barn: str) -> bool:
        about, known = read_about(target), path.stat()
        if not self._replace and about.get("asked", self._wanted) != self._wanted:
            self._others.append(str((about.get("calibration") or {}).get("id")))
            return True
        capture = about.get("capture") or {}
        same_file = (capture.get("bytes"), capture.get("mtime_ns")) == (known.st_size, known.st_mtime_ns)
        same_barn = (about.get("site") or {}).get("barn") == barn
        made = (about.get("asked"), about.get("version"))
        return same_file and same_barn and made == (self._wanted, __version__)

    @property
    def _wanted(self) -> Mapping[str, object]:
        return self._asked.to_document()

    def _conflict(self) -> Conflict:
        names = ", ".join(sorted(set(self._others))[:LISTED])
        return Conflict(
            f"{self._dataset.directory} has points of {len(self._others)} of these captures, measured with "
            f"another calibration or object model, or other settings (calibration {names}); nothing was done",
            "name another --out to have both, or --replace to have these in their place",
        )
