"""Writing a capture file, from one thread; the caller decides when to commit."""

import copy
import json
import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any, Self

from grabberd import runtime
from grabberd.archive.capture import schema
from grabberd.archive.capture.digests import FORM, FORM_KEY, write_sealed_digest
from grabberd.archive.capture.groups import GROUPED, PicturesInWaiting, PointsInWaiting
from grabberd.archive.capture.meta import (
    SEALED,
    CaptureMeta,
    check_meta,
    coverage_key,
    read_meta,
    write_marks,
    write_marks_before,
    write_meta,
)
from grabberd.archive.capture.reading_groups import RecordedChannel, RecordedReadings
from grabberd.archive.capture.recorded_channels import ChannelWriter
from grabberd.archive.capture.recorded_ledger import with_rebases
from grabberd.archive.capture.rows import RunInfo, as_far_as_written, insert_entry, write_ledger
from grabberd.archive.capture.verification import Uncommitted, check_sealed
from grabberd.core.channels.account import Account
from grabberd.core.ledger import Ledger, LedgerEntry, LedgerEvent, Slot
from grabberd.core.measurement.marks import Located
from grabberd.core.reconstruction.points import Points
from grabberd.errors import InputError, StorageError
from grabberd.files.disk import storage_errors, sync_directory

RUNNING = "running"
DONE = "done"
FAILED = "failed"

INSERT_FIELD = "INSERT INTO fields VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)"
INSERT_PICTURES = "INSERT INTO pictures VALUES (?, ?, ?, ?, ?, ?, ?)"
INSERT_RUN = "INSERT INTO runs VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)"


class CaptureWriter:
    """A capture file while it is written.

    Attributes:
        path: `NAME.grab.part` until it is sealed, then `NAME.grab`.
        meta: Metadata as given at its creation.
        runs: Committed runs, which a reader of the file finds.
    """

    def __init__(
        self,
        path: Path,
        connection: sqlite3.Connection,
        meta: CaptureMeta,
        channels: Sequence[RecordedChannel] = (),
    ) -> None:
        self.path = path
        self.meta = meta
        self.runs: list[RunInfo] = []
        self._uncommitted_runs: list[RunInfo] = []
        self._rebases: list[LedgerEvent] = []
        self._uncommitted = Uncommitted()
        self._pictures, self._points = PicturesInWaiting(), PointsInWaiting()
        self._channels = ChannelWriter(channels)
        self._undone = False
        self._connection = connection

    @classmethod
    def create(
        cls,
        path: Path,
        meta: CaptureMeta,
        max_pages: int | None = None,
        reserve_bytes: int = schema.RESERVE_BYTES,
        channels: Sequence[RecordedChannel] = (),
    ) -> Self:
        """Creates a file NAME.grab.part.

        Args:
            path: The file.
            meta: Its metadata.
            max_pages: Limits its size, for tests of a full disk.
            reserve_bytes: Space reserved for sealing it on a full disk.
            channels: Channels, numbered from 0.

        Raises:
            InputError: The metadata are invalid.
            StorageError: The file exists, or cannot be written.
        """
        try:
            check_meta(meta)
        except ValueError as error:
            hint = "look at its note and labels, and at the site and the device in the configuration"
            raise InputError(f"capture {meta.id!r} cannot begin: {error}", hint) from error
        version = schema.WITH_CHANNELS if channels else schema.VERSION
        connection = schema.create(path, max_pages, reserve_bytes, version)
        writer = cls(path, connection, meta, channels)
        with writer.discarded_if_it_fails(), storage_errors(path):
            writer._begin()
            first = {FORM_KEY: FORM, **asdict(meta)}
            write_meta(connection, first)
            connection.execute("INSERT INTO reserve VALUES (?)", (json.dumps(first, ensure_ascii=False),))
            writer._channels.begin(connection)
            writer.commit()
        return writer

    def reopen(self) -> None:
        """Reopens the file of a capture that was closed without being sealed, to seal it after all.

        Raises:
            CaptureFileError: The file is missing or damaged.
            StorageError: The file cannot be opened now.
        """
        if not self.path.exists() and schema.sealed_path(self.path).exists():
            self.path = schema.sealed_path(self.path)  # it was renamed, but synchronising its folder failed
        self._forget()  # uncommitted data were lost with the connection
        self._connection = schema.connect(self.path, writable=True)

    def begin_run(
        self, run: int, kind: str, created_utc: str, version: str, made_with: Mapping[str, Any]
    ) -> None:
        """Starts a run; `made_with` has the documents `calibration`, `object` and `settings`."""
        with self._writing():
            self._begin()
            self._connection.execute(INSERT_RUN, run_row(run, kind, created_utc, version, RUNNING, made_with))
        self._uncommitted_runs.append(
            RunInfo(run, kind, created_utc, version, RUNNING, None, dict(made_with))
        )

    def remember_marks(self, before: Sequence[tuple[int, Located]]) -> None:
        """Adds the marks of the fields before the first, with the next commit."""
        with self._writing():
            self._begin()
            write_marks_before(self._connection, before)

    def append(self, slots: Iterable[Slot]) -> None:
        """Adds fields, and the outcomes of those that were not received, with the next commit."""
        with self._writing():
            for slot in slots:
                self._begin()
                self._append(slot)

    def append_points(self, run: int, n: int, points: Points) -> None:
        """Adds one field's points, with the next commit; the fields of a run must be in order."""
        with self._writing():
            self._begin()
            if not self._points.takes(run, points):
                self._write_points()
            self._points.add(run, n, points)

    def describe_channel(self, channel: RecordedChannel) -> None:
        """Replaces the description of a channel, with the next commit."""
        with self._writing():
            self._begin()
            self._channels.describe(self._connection, channel)

    def append_readings(self, channel: int, readings: RecordedReadings) -> None:
        """Adds readings of a channel, with the next commit; they must be in order."""
        with self._writing():
            self._begin()
            self._channels.add(channel, readings)

    def keep_account(self, account: Account) -> None:
        """Sets the account of the channels, which is written with the next commit."""
        with self._writing():
            self._begin()
            self._channels.keep(account)

    def commit(self) -> None:
        """Commits everything added so far, so that it survives a crash, and reads it back.

        Raises:
            StorageError: The data cannot be written, or differ when read back.
        """
        if self._connection.in_transaction:
            with self._writing():
                self._write_pictures()
                self._write_points()
                self._uncommitted.add_readings(self._channels.write(self._connection))
                self._uncommitted.write_digests(self._connection)
                self._connection.execute("COMMIT")
            # Rebound rather than extended: another thread may be reading the list.
            self.runs = [*self.runs, *self._uncommitted_runs]
            self._uncommitted_runs = []
            self._uncommitted.read_back(self.path, self._connection)

    def seal(
        self,
        ledger: Ledger,
        *,
        complete: bool,
        ended_because: str,
        measuring_failure: str | None = None,
        findings: Mapping[str, Any] | None = None,
        coverage: Mapping[int, Mapping[str, Any]] | None = None,
    ) -> Path:
        """Writes ledger and verdict, closes the file, reads it back and gives it its final name.

        Data that can no longer be committed (on a full disk) are entered as lost; the rest is kept.

        Args:
            ledger: Outcome of every field.
            complete: True if nothing is lost or damaged.
            ended_because: Reason why the capture ended.
            measuring_failure: Reason why measuring failed, if it did.
            findings: Additions to the metadata's `extra`.
            coverage: How well runs were measured, by their numbers.

        Raises:
            StorageError: Not even that is possible, or the file differs when read back; it remains as
                `.grab.part` and is sealed at the next start.
        """
        self._commit_what_fits()
        # A copy: a capture that was given up may still be recording, and the ledger is compared below.
        ledger = copy.deepcopy(ledger)
        with storage_errors(self.path):
            self._connection.execute("BEGIN IMMEDIATE")
            self._connection.execute(schema.FREE_RESERVE)  # first, to free pages for what follows
            written = as_far_as_written(self._connection, ledger)
            write_ledger(self._connection, written)
            state, reason = (FAILED, measuring_failure) if measuring_failure else (DONE, None)
            self._connection.execute(
                "UPDATE runs SET state = ?, reason = ? WHERE state = ?", (state, reason, RUNNING)
            )
            verdict = {"state": SEALED, "complete": complete, "ended_because": ended_because}
            extra = with_rebases({**read_meta(self._connection).extra, **(findings or {})}, ledger.events)
            covered = {coverage_key(run): document for run, document in (coverage or {}).items()}
            write_meta(self._connection, {**verdict, "extra": extra, **covered})
            self._channels.seal(self._connection)
            write_sealed_digest(self._connection)
            self._connection.execute("COMMIT")
            # A sealed capture is one file, so the journal is removed: after the commit, since SQLite changes
            # its mode only between transactions, and before the renaming, since it is found by name.
            self._connection.execute("PRAGMA journal_mode = DELETE")
            self._connection.close()
            check_sealed(self.path, written, complete=complete, runs=[run.run for run in self.runs])
            self.path = publish(self.path)
        return self.path

    def close(self) -> None:
        """Closes the file without sealing it; what was not committed is lost."""
        self._connection.close()

    def discard(self) -> None:
        """Closes the file and deletes it."""
        self.close()
        schema.remove_with_journal(self.path)

    @contextmanager
    def discarded_if_it_fails(self) -> Iterator[None]:
        """Closes and deletes the file if the block fails, which makes it ready to record."""
        try:
            yield
        except BaseException:
            with suppress(OSError):
                self.discard()
            raise

    def _begin(self) -> None:
        if not self._connection.in_transaction:
            self._connection.execute("BEGIN")

    def _commit_what_fits(self) -> None:
        try:
            self.commit()
        except StorageError:
            if self._connection.in_transaction:
                self._connection.execute("ROLLBACK")
                self._forget()
            elif not self._undone:
                raise  # committed, but it differs when read back

    def _forget(self) -> None:
        """Drops uncommitted data."""
        self._uncommitted.forget()
        self._pictures, self._points = PicturesInWaiting(), PointsInWaiting()
        self._channels.forget()

    def _append(self, slot: Slot) -> None:
        for entry in slot.lost_before:
            insert_entry(self._connection, entry)
        if slot.rebases:
            self._rebases += slot.rebases
            write_meta(self._connection, {"extra": with_rebases(self.meta.extra, self._rebases)})
        if slot.numbered is not None:
            if not self._pictures.takes(slot.numbered.packed):
                self._write_pictures()
            self._pictures.add(slot.numbered, str(slot.outcome), slot.reason)
        else:
            insert_entry(
                self._connection, LedgerEntry(slot.n, 1, slot.outcome, slot.reason or str(slot.outcome))
            )

    def _write_pictures(self) -> None:
        """Writes the collected fields as a group, completely or not at all."""
        waiting, self._pictures = self._pictures, PicturesInWaiting()
        if waiting:
            group = waiting.group()
            with self._whole():
                self._connection.execute(INSERT_PICTURES, group.row)
                self._connection.executemany(INSERT_FIELD, group.recorded)
                write_marks(self._connection, waiting.marks)
            self._uncommitted.add_pictures(group, waiting.newest)

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """Translates errors; drops uncommitted data if SQLite has rolled back, as it may on a full disk."""
        with storage_errors(self.path):
            try:
                yield
            except BaseException:
                if not self._connection.in_transaction:
                    self._undone = True
                    self._forget()
                raise

    @contextmanager
    def _whole(self) -> Iterator[None]:
        """Rolls back the block's part of the transaction if it fails."""
        self._connection.execute("SAVEPOINT whole")
        try:
            yield
        except BaseException:
            if self._connection.in_transaction:
                self._connection.execute("ROLLBACK TO whole")
                self._connection.execute("RELEASE whole")
            raise
        self._connection.execute("RELEASE whole")

    def _write_points(self) -> None:
        """Writes the collected points as a group."""
        waiting, self._points = self._points, PointsInWaiting()
        if waiting:
            group = waiting.group()
            self._connection.execute(GROUPED.insert, group.row)
            self._uncommitted.add_points(group, waiting.newest)


def publish(part: Path) -> Path:
    """Gives a sealed capture its final name, durably.

    Raises:
        StorageError: Another capture has that name; nothing is overwritten.
    """
    final = schema.sealed_path(part)
    if final != part:
        if final.exists():
            raise StorageError(
                f"{final} exists already", f"move it away, then start again to seal {part.name}"
            )
        runtime.rename(part, final)
        sync_directory(final.parent)
    return final


def run_row(
    run: int, kind: str, created_utc: str, version: str, state: str, made_with: Mapping[str, Any]
) -> tuple[object, ...]:
    """A row of the table `runs`."""
    documents = [
        json.dumps(made_with.get(key), ensure_ascii=False) for key in ("calibration", "object", "settings")
    ]
    return (run, kind, created_utc, version, state, None, *documents)
