"""Holds a world's daemon to what it has promised, by what the world itself knows.

Written apart from the daemon: files are read as SQLite databases by their documented tables; only pictures
are unpacked by the program's reader, and each has its number in it.
"""

import re
import sqlite3
from collections import Counter
from collections.abc import Iterator
from contextlib import closing
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from tests.proofs.world.camera import Truth, number_in
from tests.proofs.world.levels import levels, open_files
from tests.proofs.world.record import Asked, Job

from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.verification import check_file
from grabberd.documents.captures import CaptureDocument
from grabberd.documents.state import StateDocument

if TYPE_CHECKING:
    from tests.proofs.world.world import World

NS = 10**9
FAILED_NS = 30 * NS
"""A job in quiet has ended by then."""
PROMISED_NS = NS
"""A crash costs no more."""
_UNCERTAIN = re.compile(r"number uncertain by up to (\d+)")
_OFF = re.compile(r"numbers from here on are (\d+) too (high|low)")
_WITHOUT_FIELDS = ("ring overrun", "disk too slow", "not written to disk", "the program ended", "storage")
"""Reasons for which a field that the program has taken may be missing all the same."""
ALARMS = {
    "unplugged": ("device absent", "device recovering", "device failed"),
    "no signal": ("device no_signal",),
    "stall": ("device recovering", "device failed", "device opening"),
    "stream fails": ("device recovering", "device failed", "device opening"),
    "logger unplugged": ("logger absent", "fault logger_failed"),
}
"""What a page must show at least once, of each fault that lasts for `SEEN_S`."""
SEEN_S = 4.0
OF_COMPUTER = ("threads", "open files")
OF_CAPTURES = tuple(f"objects {name}" for name in ("Recording", "Recorder", "CaptureWriter", "RingReader"))
"""Each device keeps its last one."""
SOME_MORE = 3
"""What may come with the first capture and the first job, and stays."""
A_FEW_SECONDS = 120
"""Objects of readings and fields that are kept for some seconds, beside three for each capture and job."""


class Row(NamedTuple):
    """A field in a file: its number there and in its picture, its time, and what is said of it."""

    n: int
    k: int
    time_ns: int
    outcome: str
    uncertain: int


class Sealed(NamedTuple):
    """A sealed file by its tables.

    Attributes:
        rows: Its fields.
        entries: first_n, count, outcome and reason of all others.
        too_high: From which number on, by how many.
        damages: What the program's own verification finds wrong.
        complete: What it says of itself.
        ended_because: Likewise.
    """

    rows: list[Row]
    entries: list[tuple[int, int, str, str]]
    too_high: list[tuple[int, int]]
    damages: list[str]
    complete: bool
    ended_because: str

    @property
    def end_n(self) -> int:
        """The number after the last field."""
        return max([self.rows[-1].n + 1, *(first_n + count for first_n, count, _, _ in self.entries)])

    def k_of(self, n: int, base: int) -> int:
        """The camera's number of a field that the file numbers n."""
        return base + n - sum(by for first_n, by in self.too_high if first_n <= n)


def audit(world: "World") -> list[str]:
    """What is not as it should be, in sentences."""
    checks = (_captures, _jobs, _annotations, _alarms, _all_is_over, _flat)
    found = [lie for check in checks for lie in check(world)]
    found += [
        f"refused in quiet: {what}" for at_ns, what in world.record.refusals if world.is_quiet(at_ns, at_ns)
    ]
    world.look_at_files()
    return found


def _captures(world: "World") -> Iterator[str]:
    folder = world.computer.disk.folder / "captures"
    for name, asked in world.record.captures.items():
        yield from audit_capture(world, name)
        if not asked.deleted and not (folder / f"{name}.grab").exists():
            yield from _is_missing(world, name, asked, folder)
    yield from (f"{path.name} is unsealed in the calm" for path in folder.glob("*.part"))
    for path in folder.glob("damaged/*.part"):
        # One that a crash cut off before anybody was told of it may be kept so, with the reason.
        if path.name.partition(".")[0] in world.record.captures:
            yield f"{path.name} was set aside: {_reason(path)}"


def audit_sealed(world: "World") -> list[str]:
    """What is wrong with the captures that are sealed by now."""
    return [lie for name in world.record.captures for lie in audit_capture(world, name)]


def audit_capture(world: "World", name: str) -> Iterator[str]:
    """What is wrong with a capture, if it is sealed."""
    if (file := sealed(world, name)) is not None:
        asked = world.record.captures[name]
        yield from (f"capture {name}: {lie}" for lie in _of_capture(world, asked, file))


def sealed(world: "World", name: str) -> Sealed | None:
    """The file of a capture; None if it is not sealed. It is read once, since it never changes."""
    path = world.computer.disk.folder / "captures" / f"{name}.grab"
    if not path.exists():
        return None
    if name not in world.record.files:
        with world.computer.disk.sparing():
            world.record.files[name] = read(path)
    return world.record.files[name]


def still_open(world: "World") -> Iterator[str]:
    """Files that a daemon that has stopped has left open; one that was killed could not close them."""
    left = open_files(world.computer.disk.folder)
    left = [one for one in left if not one.endswith("jobs/.lock")]  # a child's
    if left and not world.record.crashes:
        yield f"open after the stop: {left}"


def _reason(path: Path) -> str:
    text = path.with_name(path.name + ".txt")
    return text.read_text() if text.exists() else "no reason"


def _is_missing(world: "World", name: str, asked: Asked, folder: Path) -> Iterator[str]:
    cut = any(
        crash.power_cut
        and asked.started.asked_ns <= crash.at_ns <= (asked.started.answered_ns or 0) + PROMISED_NS
        for crash in world.record.crashes
    )
    if not cut and not (folder / "damaged" / f"{name}.grab.part").exists():
        yield f"capture {name} is gone; files: {sorted(one.name for one in folder.iterdir())}"


def read(path: Path) -> Sealed:
    """A capture file."""
    with closing(sqlite3.connect(path)) as connection:
        meta = dict(connection.execute("SELECT key, value FROM meta"))
        fields = connection.execute("SELECT n, time_ns, outcome, reason FROM fields ORDER BY n").fetchall()
        entries = connection.execute(
            "SELECT first_n, count, outcome, reason FROM ledger ORDER BY 1"
        ).fetchall()
    with CaptureReader(path) as reader:
        numbers = {one.numbered.n: number_in(one.numbered.packed) for one in reader.fields()}
        events = [(event.n, event.reason) for event in reader.ledger.events]
    rows = [Row(n, numbers[n], time_ns, outcome, _stated(reason)) for n, time_ns, outcome, reason in fields]
    too_high = [(n, by) for n, reason in events if (by := _too_high_by(reason))]
    damages = check_file(path).damages
    return Sealed(rows, entries, too_high, damages, meta["complete"] == "true", meta.get("ended_because", ""))


def _stated(reason: str | None) -> int:
    found = _UNCERTAIN.search(reason or "")
    return int(found[1]) if found else 0


def _too_high_by(reason: str) -> int:
    found = _OFF.search(reason)
    return 0 if found is None else int(found[1]) * (1 if found[2] == "high" else -1)


def _of_capture(world: "World", asked: Asked, file: Sealed) -> Iterator[str]:
    truth = world.cameras[asked.device].truth
    yield from file.damages
    certain = next((row for row in file.rows if not row.uncertain), None)
    if certain is None:
        return
    base = certain.k - (file.k_of(certain.n, 0))
    yield from _numbers(file, truth, base, _latest_ns(world, asked.device))
    yield from _accounted(file)
    yield from _losses(world, file, truth, base)
    yield from _begin(file, asked, truth, base)
    yield from _end(world, file, asked, truth, base)
    yield from _verdict(world, file, asked, truth, base)


def _accounted(file: Sealed) -> Iterator[str]:
    """Every field from the first to the last is there once, or said to be missing once."""
    there = {row.n: row.outcome for row in file.rows}
    entered = [(n, one[2]) for one in file.entries for n in range(one[0], one[0] + one[1])]
    for n, outcome in entered:
        if there.get(n, outcome) != outcome:
            yield f"field {n} is entered as {outcome}, and is there as {there[n]}"
            return
    numbers = sorted([*there, *(n for n, _ in entered if n not in there)])
    for before, n in pairwise(numbers):
        if n != before + 1:
            yield f"field {before + 1} is in no entry" if n > before else f"field {n} is entered twice"
            return


def _verdict(world: "World", file: Sealed, asked: Asked, truth: Truth, base: int) -> Iterator[str]:
    if file.complete and file.entries:
        yield f"it is complete, and has lost {file.entries[0]}"
    end_ns = truth.exposed_ns(file.k_of(file.end_n, base))
    if not file.complete and world.is_quiet(asked.started.asked_ns, end_ns):
        yield f"it is incomplete for {file.entries[:1]} and {file.ended_because!r}, and nothing went wrong"


def _latest_ns(world: "World", device: str) -> int:
    """By how much a time of arrival may be after the exposure, which a driver with no other does not tell."""
    camera = world.cameras[device]
    if not camera.driver.stamps_arrival:
        return 0
    return camera.driver.latency_ns + round(max((one.amount for one in camera.late), default=0.0) * NS)


def _numbers(file: Sealed, truth: Truth, base: int, latest_ns: int) -> Iterator[str]:
    for row in file.rows:
        if abs(row.k - file.k_of(row.n, base)) > row.uncertain:
            yield f"numbering: field {row.n} is the camera's {row.k}, not {file.k_of(row.n, base)}"
            return
        late_ns = row.time_ns - truth.exposed_ns(row.k)
        if not -1.5 * truth.period_ns <= late_ns / (1 + row.uncertain) <= 1.5 * truth.period_ns + latest_ns:
            yield f"numbering: field {row.n} was exposed {-late_ns / 1e6:+.0f} ms from its time"
            return


def _losses(world: "World", file: Sealed, truth: Truth, base: int) -> Iterator[str]:
    """Fields that the program has taken, and that are said to have been lost before."""
    if any(row.uncertain for row in file.rows) or file.too_high:
        return
    for first_n, count, outcome, reason in file.entries:
        if outcome == "damaged" or any(words in reason for words in _WITHOUT_FIELDS):
            continue
        first_k = file.k_of(first_n, base)
        at_ns = truth.exposed_ns(first_k)
        if outcome == "no_signal" and not world.was("no signal", at_ns):
            yield f"fields from {first_n} on are without a signal, which there was"
        taken = set(range(first_k, first_k + count)) - truth.missing_between(first_k, first_k + count)
        if taken:
            yield f"fields {sorted(taken)[:5]} of the camera came, and are {outcome} for {reason}"


def _begin(file: Sealed, asked: Asked, truth: Truth, base: int) -> Iterator[str]:
    first_n = min([file.rows[0].n, *(entry[0] for entry in file.entries)])
    begin_ns = truth.exposed_ns(file.k_of(first_n, base))
    least_ns = asked.started.asked_ns - asked.pre_fields * truth.period_ns - 2 * truth.period_ns
    most_ns = (asked.started.answered_ns or 0) + 2 * truth.period_ns
    if not least_ns <= begin_ns <= most_ns:
        yield f"it begins {(begin_ns - asked.started.asked_ns) / NS:+.3f} s from when it was asked for"


def _end(world: "World", file: Sealed, asked: Asked, truth: Truth, base: int) -> Iterator[str]:
    end_n = file.end_n
    end_ns = truth.exposed_ns(file.k_of(end_n, base))
    last_ns = truth.exposed_ns(file.rows[-1].k)
    crashed_ns = _crash_in(world, asked, end_ns)
    if crashed_ns is not None:
        is_whole = asked.fields is not None and end_n >= asked.fields
        if file.complete and not is_whole and "the program ended" in file.ended_because:
            yield f"it is complete, and ended because {file.ended_because}"
        yield from _after_crash(world, file, truth, crashed_ns, last_ns)
    elif (
        asked.fields is not None
        and "length reached" in file.ended_because
        and asked.stopped is None
        and not (asked.fields <= end_n <= asked.fields + asked.pre_fields)
    ):
        yield f"it has {end_n} of {asked.fields} fields"
    elif "by the operator" in file.ended_because and asked.stopped is not None:
        early_ns = asked.stopped.asked_ns - end_ns
        if early_ns > 2 * truth.period_ns:
            yield f"it ends {early_ns / NS:.3f} s before it was stopped"


def _crash_in(world: "World", asked: Asked, end_ns: int) -> int | None:
    for crash in world.record.crashes:
        if asked.started.asked_ns < crash.at_ns and end_ns > crash.at_ns - 10 * NS:
            stopped = asked.stopped is not None and asked.stopped.asked_ns < crash.at_ns
            if not stopped and (asked.sealed_ns is None or asked.sealed_ns > crash.at_ns):
                return crash.at_ns
    return None


def _after_crash(world: "World", file: Sealed, truth: Truth, crashed_ns: int, last_ns: int) -> Iterator[str]:
    if "the program ended" not in file.ended_because:
        return
    others = {one.fault for one in world.spells if one.begin_ns - 15 * NS < crashed_ns < one.end_ns + 15 * NS}
    if others & {"computer frozen", "computer busy", "disk slow", "disk hangs", "fields late"} or any(
        name.startswith("disk") for name in others
    ):
        return
    due = range(_k_at(truth, last_ns) + 1, _k_at(truth, crashed_ns - PROMISED_NS))
    lost = set(due) - truth.missing_between(due.start, max(due.stop, due.start))
    if lost:
        yield f"a crash has cost {(crashed_ns - last_ns) / NS:.3f} s, {len(lost)} fields beyond the second"


def _k_at(truth: Truth, time_ns: int) -> int:
    return (time_ns - truth.begin_ns) // truth.period_ns


def _jobs(world: "World") -> Iterator[str]:
    service = world.daemon.service
    known = {} if service is None else {one.id: one for one in service.jobs.list()}
    for name, job in world.record.jobs.items():
        if job.submitted_ns:
            now = known.get(name)
            state = now.state.value if now is not None else "lost"
            yield from (f"{name} {lie}" for lie in _of_job(job, state, len(world.record.crashes)))
            if int(name.removeprefix("job-")) < job.submitted_utc_s - 1:
                yield f"{name} has a number of before {job.submitted_utc_s:.0f}"
            if state == "failed" and world.is_quiet(job.submitted_ns, job.submitted_ns + FAILED_NS):
                yield f"{name} has failed, and nothing went wrong"


def _flat(world: "World") -> Iterator[str]:
    """Nothing has grown with the fields, readings, commits and requests that have passed."""
    for what, count in levels(world).items():
        # Objects of a daemon that was killed may still be there; its threads and files are not.
        if count > _most(world, what) and (what in OF_COMPUTER or world.daemon.starts == 1):
            yield f"{count} {what} in the calm, {world.levels[what]} at the start"


def _most(world: "World", what: str) -> int:
    if what in OF_COMPUTER:
        return world.levels[what] + SOME_MORE
    if what in OF_CAPTURES:
        return world.levels[what] + len(world.cameras)
    return world.levels[what] + A_FEW_SECONDS + 3 * (len(world.record.captures) + len(world.record.jobs))


def _of_job(job: Job, state: str, crashes: int) -> Iterator[str]:
    if state in ("lost", "queued", "running"):
        yield f"is {state} in the calm, begun {len(job.begun_ns)} times"
    if state == "done" and not job.done_ns:
        yield "is done, and nobody has done it"
    if job.ended is not None and any(begun_ns > job.ended[1] for begun_ns in job.begun_ns):
        yield f"has begun again after it was {job.ended[0]}"
    if job.ended is not None and job.ended[0] != state:
        yield f"was {job.ended[0]}, and is {state}"
    if len(job.done_ns) > 1 + crashes:
        yield f"was done {len(job.done_ns)} times"


def _annotations(world: "World") -> Iterator[str]:
    service = world.daemon.service
    for name, asked in world.record.captures.items():
        if service is None or asked.deleted:
            continue
        kept = service.state_keeper and service.archive.document(name)
        if kept.state != "sealed":
            yield f"capture {name} is {kept.state} in the calm"
        if kept.note not in asked.notes:
            yield f"capture {name} has the note {kept.note!r}, not {asked.notes}"
        if kept.pinned not in asked.pins:
            yield f"capture {name} is pinned: {kept.pinned}, not {asked.pins}"
        if (file := sealed(world, name)) is not None:
            yield from (
                f"capture {name} is described otherwise than it is: {lie}" for lie in _shown(kept, file)
            )


def _shown(kept: CaptureDocument, file: Sealed) -> Iterator[str]:
    """What a client is shown of a file, and is not in it."""
    counts = Counter(row.outcome for row in file.rows if row.outcome == "received")
    for _, count, outcome, _ in file.entries:
        counts[outcome] += count
    ledger = kept.ledger
    if {outcome.value: count for outcome, count in ledger.counts.items() if count} != counts:
        yield f"{ledger.counts}, not {dict(counts)}"
    if (kept.fields, kept.verdict == "complete") != (len(file.rows), file.complete):
        yield f"{kept.fields} fields, {kept.verdict}, not {len(file.rows)}"
    listed = [(one.first_n, one.count, one.outcome.value, one.reason) for one in ledger.entries]
    if listed != file.entries[: len(listed)] or len(listed) + ledger.entries_not_listed != len(file.entries):
        yield f"{listed}, not {file.entries}"
    if ledger.in_words.startswith("complete") != (not file.entries and bool(file.rows)):
        yield f"{ledger.in_words!r}"


def _alarms(world: "World") -> Iterator[str]:
    # Of a device that is away nothing else can be said.
    downs = [
        one
        for one in world.spells
        if not one.fault.startswith(("fields", "logger", "clock", "stall", "stream", "no signal"))
    ]
    for spell in world.spells:
        wanted = ALARMS.get(spell.fault)
        long = spell.end_ns - spell.begin_ns >= SEEN_S * NS
        disturbed = any(
            one.begin_ns < spell.end_ns and one.end_ns + 8 * NS > spell.begin_ns
            for one in downs
            if not one.fault == spell.fault == "unplugged"
        )
        if wanted is None or not long or disturbed:
            continue
        seen = {
            what for at_ns, what in world.record.states if spell.begin_ns <= at_ns <= spell.end_ns + 2 * NS
        }
        if not seen & set(wanted):
            lasted_s = (spell.end_ns - spell.begin_ns) / NS
            yield f"no alarm of {spell.fault} for {lasted_s:.0f} s, but {sorted(seen)}"


def _all_is_over(world: "World") -> Iterator[str]:
    """Nothing is left of the weather in the calm."""
    service = world.daemon.service
    if service is None:
        yield "there is no daemon in the calm"
        return
    state = world.daemon.call(service.state)
    yield from _of_parts(state)
    for fault in state.faults:
        yield f"fault {fault.cause_code.value} in the calm: {fault.message}"
    if state.storage.problem:
        yield f"the disk has a problem in the calm: {state.storage.problem}"


def _of_parts(state: StateDocument) -> Iterator[str]:
    for name, device in state.devices.items():
        if device.state.value not in ("ready", "capturing"):
            yield f"device {name} is {device.state.value} in the calm: {device.cause}"
    for name, logger in state.loggers.items():
        if logger.state.value != "ready":
            yield f"logger {name} is {logger.state.value} in the calm"
