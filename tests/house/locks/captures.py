"""Capture files: what is read from those of every format, and the rows of those that are written today."""

import shutil
import sqlite3
import tempfile
from collections.abc import Iterator
from contextlib import closing
from dataclasses import asdict, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import grabberd

from .computer import packages
from .doors import CaptureReader, CaptureWriter, Slot
from .exits import FORMAT_1, run
from .kept import canonical, digest, plain

EXAMPLES = ("frame.grab", "object.grab", "liner.grab")
LONGEST = 120
"""Characters of a value that is kept as it is; of a longer one, the digest is."""
RUN = 1
CONVERSION = ("conversion", "digest.sealed")
"""Keys that hold, or cover, the time at which `grabberd storage convert` was run."""


def read() -> dict[str, Any]:
    """Content of the committed captures of formats 1, 2 and 3."""
    return {file.name: _content(file) for file in _files()}


def written() -> dict[str, Any]:
    """Rows of a capture with channels that is written today from what another one holds."""
    with tempfile.TemporaryDirectory() as folder:
        return {"packages": packages("zstandard"), **tables(_copied(Path(folder)))}


def converted() -> dict[str, Any]:
    """Rows of captures of format 1 that `grabberd storage convert` has converted."""
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in ("one-bit.grab", "eight-bits.grab", "six-bits.grab", "simulated.grab"):
            path = Path(shutil.copy(FORMAT_1 / name, folder))
            done = run(["storage", "convert", str(path)], Path(folder))
            assert done["exit"] == 0, done
            found[name] = tables(path)
    return {"packages": packages("zstandard"), **found}


def tables(path: Path) -> dict[str, Any]:
    """Pragmas of a SQLite file; of each table its SQL, and digests of its rows without and with blobs."""
    uri = f"{path.absolute().as_uri()}?mode=ro"
    with closing(sqlite3.connect(uri, uri=True)) as connection:
        names = ("application_id", "user_version", "page_size", "auto_vacuum", "encoding")
        pragmas = {name: connection.execute(f"PRAGMA {name}").fetchone()[0] for name in names}
        schema = connection.execute("SELECT name, sql FROM sqlite_master WHERE sql IS NOT NULL ORDER BY name")
        found = {name: _table(connection, name, sql) for name, sql in schema.fetchall()}
    return {"pragmas": pragmas, "tables": found}


def without_blobs(document: Any) -> Any:
    """The document without what a packer of another version packs in another way."""
    if isinstance(document, dict):
        return {key: without_blobs(one) for key, one in document.items() if key not in {"blobs", "packages"}}
    return document


def _table(connection: sqlite3.Connection, name: str, sql: str) -> dict[str, Any]:
    rows = connection.execute(f"SELECT * FROM {name}").fetchall()
    values = [[f"{len(one)} bytes" if isinstance(one, bytes) else one for one in row] for row in rows]
    packed = [[digest(one) for one in row if isinstance(one, bytes)] for row in rows]
    if name == "meta":
        return {"sql": sql, "rows": dict(_meta(rows)), "blobs": ""}
    lengths = [["bytes" if isinstance(one, bytes) else one for one in row] for row in rows]
    return {
        "sql": sql,
        "count": len(rows),
        "rows": digest(canonical(lengths)),
        "blobs": digest(canonical([values, packed])),
    }


def _meta(rows: list[Any]) -> Iterator[tuple[str, str]]:
    converted = any(key == CONVERSION[0] for key, _ in rows)
    for key, value in rows:
        if converted and key in CONVERSION:
            yield key, "…"
        else:
            yield key, value if len(value) <= LONGEST else digest(value)


def _files() -> list[Path]:
    return [*(grabberd.example(name) for name in EXAMPLES), *sorted(FORMAT_1.glob("*.grab*"))]


def _content(file: Path) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder, grabberd.open(shutil.copy(file, folder)) as capture:
        return {
            "meta": {key: _short(value) for key, value in plain(asdict(capture.meta)).items()},
            "fields": _fields(capture),
            "ledger": {
                "counts": plain(capture.ledger.counts()),
                "complete": capture.ledger.complete,
                "in_words": capture.ledger.in_words(capture.rate_hz),
            },
            "runs": [{key: _short(one) for key, one in plain(run._asdict()).items()} for run in capture.runs],
            "points": {str(run.run): _points(capture, run.run) for run in capture.runs},
            "channels": _channels(capture.path),
        }


def _short(value: Any) -> Any:
    return value if len(canonical(value)) <= LONGEST else digest(canonical(value))


def _fields(capture: grabberd.Capture) -> dict[str, Any]:
    bits, about = sha256(), []
    for one in capture.fields:
        packed = one.packed
        bits.update(packed.data.tobytes())
        shape = [packed.parity, packed.y0, packed.y_step, packed.rows, packed.columns, packed.bits]
        about.append([one.n, one.time_s, str(one.outcome), one.reason, *map(int, [*shape, packed.threshold])])
    pictures = [digest(capture.fields[one[0]].picture.tobytes()) for one in about[:2]]
    return {
        "count": len(about),
        "bits": bits.hexdigest()[:16],
        "first": about[:2],
        "about": digest(canonical(about)),
        "pictures": pictures,
    }


def _points(capture: grabberd.Capture, run: int) -> dict[str, Any]:
    table = capture.points(run)
    columns = {name: digest(table[name].tobytes()) for name in table.units}
    return {"rows": len(table), "columns": columns, "units": table.units, "about": _short(table.about)}


def _channels(path: Path) -> dict[str, Any]:
    with CaptureReader(path) as reader:
        found = {}
        for one in reader.channels.all:
            groups = list(reader.channels.groups(one))
            found[one.name] = {
                "channel": plain(one._asdict()),
                "times": digest(b"".join(group.time_ns.tobytes() for group in groups)),
                "values": digest(b"".join(group.value.tobytes() for group in groups)),
            }
        account = reader.channels.account
        return {"all": found, "account": None if account is None else digest(repr(account))}


def _copied(folder: Path) -> Path:
    """A capture of the same fields, points and readings, each committed at once."""
    with CaptureReader(grabberd.example("liner.grab")) as reader:
        meta = replace(reader.meta, state="recording", complete=None)
        channels = reader.channels.all
        writer = CaptureWriter.create(folder / "liner.grab.part", meta, channels=channels)
        run = reader.run(RUN)
        writer.begin_run(run.run, run.kind, run.created_utc, run.version, run.made_with)
        writer.append(
            Slot(one.numbered, one.numbered.n, one.outcome, one.reason, (), one.numbered.time_ns)
            for one in reader.fields()
        )
        for n, points in reader.points(RUN):
            writer.append_points(RUN, n, points)
        for one in channels:
            for readings in reader.channels.groups(one):
                writer.append_readings(one.channel, readings)
        if (account := reader.channels.account) is not None:
            writer.keep_account(account)
        writer.commit()
        because = str(reader.meta.ended_because)
        coverage = {RUN: run.coverage or {}}
        return writer.seal(reader.ledger, complete=True, ended_because=because, coverage=coverage)
