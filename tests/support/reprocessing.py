"""Small archives of captures of the simulated liner, and what measures them again."""

import shutil
from collections.abc import Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pyarrow.dataset

from archive.captures import write
from core.chain.fake_scene import Scene, take_scene
from grabberd.config import shipped_configs
from grabberd.core.ledger import Outcome, Slot
from grabberd_reprocess.reprocess_archive import (
    OnProgress,
    ReprocessRequest,
    ReprocessSummary,
    reprocess_archive,
)
from grabberd_reprocess.workers import Workers

CALIBRATION = shipped_configs() / "fake.calibration.json"
OBJECT = shipped_configs() / "objects" / "liner.yaml"
MANUAL = Path(__file__).parents[2] / "docs" / "howto"
FIELDS = 6


@cache
def scene(fields: int = FIELDS) -> Scene:
    return take_scene(fields, scene="liner")


def add_capture(folder: Path, name: str, fields: int = FIELDS, **changes: Any) -> Path:
    """A sealed capture; changes are those of its meta data."""
    slots = [
        Slot(one, one.n, Outcome.RECEIVED, None, (), one.time_ns)
        for one in scene(fields).packed(1, "doubled")
    ]
    begun = {"id": name, "start_ns": slots[0].numbered.time_ns, "lines": "doubled"}  # type: ignore[union-attr]
    return Path(write(folder, slots, name=name, **{**begun, **changes}))


def archive(folder: Path, captures: int, fields: int = FIELDS) -> list[Path]:
    """Captures of two barns on three days; all but the first are copies under other names."""
    folder.mkdir(parents=True, exist_ok=True)
    return [
        add_capture(
            folder,
            f"capture-{number}",
            fields,
            site={"barn": ("Ås", "Stall 3/Nord")[number % 2]},
            created_utc=f"2026-03-{1 + number % 3:02d}T09:30:00.000Z",
        )
        for number in range(captures)
    ]


@contextmanager
def one_thread(_: Path) -> Iterator[Workers]:
    def start() -> Executor:
        return ThreadPoolExecutor(1)

    yield Workers(start, 1)


def measured(
    sources: Path | list[Path], out: Path, *, on_progress: OnProgress = lambda _: None, **changes: Any
) -> ReprocessSummary:
    listed = [str(source) for source in (sources if isinstance(sources, list) else [sources])]
    return reprocess_archive(
        replace(ReprocessRequest(listed, out, CALIBRATION, OBJECT), **changes), one_thread, on_progress
    )


def table(out: Path) -> Any:
    return pyarrow.dataset.dataset(out, partitioning="hive").to_table()


def files(out: Path) -> list[Path]:
    return sorted(out.glob("barn=*/day=*/*"))


def only_finished(out: Path) -> bool:
    """Whether nothing lies about that is half."""
    return {path.suffix for path in files(out)} <= {".parquet"} and not (out / "_scratch").exists()


def copied(path: Path, to: Path) -> Path:
    to.parent.mkdir(parents=True, exist_ok=True)
    return Path(shutil.copy(path, to))
