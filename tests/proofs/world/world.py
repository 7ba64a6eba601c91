"""One world: a computer, cameras, a logger, the daemon and its clients; a spell of weather, and a calm."""

import hashlib
import logging
import random
import shutil
import signal
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from tests.proofs.world.auditor import audit, audit_capture, audit_sealed, still_open
from tests.proofs.world.camera import Camera, Driver
from tests.proofs.world.clients import Client, Operator, Page, Researcher
from tests.proofs.world.computer import Computer
from tests.proofs.world.daemon import Daemon, WorldJob
from tests.proofs.world.levels import levels
from tests.proofs.world.logger import WorldLogger
from tests.proofs.world.record import Crash, Job, Record
from tests.proofs.world.waiting import Deadlock
from tests.proofs.world.weather import FAULTS, NEVER_NS, PAIRS, Spell, faults_of

from grabberd import runtime

STORM_S, CALM_S = 60.0, 80.0
"""The calm is longer than anything is put off: a minute between attempts to seal, and what a disk owes."""
BETWEEN_S = 60.0
"""Mean time from one pair of faults to the next where the storm is longer."""
AGED_S = 30.0
FORGOTTEN_NS, SOON_NS = 60 * 10**9, 2 * 10**9
"""Until a fault has no consequences, at the most; and what may be in the making when it begins."""
LONGEST_S = 40.0
"""Processor time after which a world is given up; it takes two seconds."""


class Enough(Exception):
    """A world has been caught lying, which is all that was asked."""


class Outcome(NamedTuple):
    """What came of a seed.

    Attributes:
        seed: The seed.
        faults: Its weather.
        fields: Fields that its cameras delivered.
        captures, jobs: Those that clients were told to have.
        trace: Hash of all decisions.
        lies: What was not as it should be.
        simulated_s, processor_s: Time that passed in it, and what it took.
        megabytes: After a quarter of a long storm, and at its end.
    """

    seed: int
    faults: tuple[str, ...]
    fields: int
    captures: int
    jobs: int
    trace: int
    lies: tuple[str, ...]
    simulated_s: float
    processor_s: float
    megabytes: tuple[float, float]


class World:
    """See above.

    Args:
        seed: of all decisions.
        folder: The state directory.
        faults: Its weather; None: that of the seed.
        storm_s: Length of the storm.
        until_lie: Ends soon after the first lie.

    Attributes:
        computer, cameras, logger, daemon: Its parts.
        record: What clients were told.
        spells: The weather that was, and is.
        levels: What the daemon held when it had just been started.
        is_calm: True once nothing goes wrong any more.
        turn: Held by who ends the daemon and starts it again.
    """

    def __init__(
        self,
        seed: int,
        folder: Path,
        faults: tuple[str, ...] | None = None,
        storm_s: float = STORM_S,
        *,
        until_lie: bool = False,
    ) -> None:
        self.seed, self.storm_s, self._until_lie = seed, storm_s, until_lie
        self.draw = random.Random(f"weather {seed}")
        self.faults = faults_of(seed, self.draw) if faults is None else faults
        self.computer = Computer(seed, folder, switch_every=self.draw.choice((3.0, 10.0, 40.0, 200.0)))
        self.cameras = {name: self._camera() for name in ("cup", "other")[: self.draw.choice((1, 1, 1, 2))]}
        self.logger = WorldLogger(self.computer)
        self.daemon = Daemon(self.computer, self.cameras, {"vacuum": self.logger.setup()})
        self.record, self.spells, self.is_calm = Record(), list[Spell](), False
        self.levels, self._due = Counter[str](), 0
        self.turn = self.computer.lock()
        self.megabytes: list[float] = []

    def _camera(self) -> Camera:
        draw = self.draw
        driver = Driver(
            buffers=draw.choice((4, 8, 16, 32)),
            counts=draw.random() < 0.5,
            stamps_arrival=draw.random() < 0.3,
            jitter_ns=draw.choice((50_000, 500_000, 2_000_000)),
        )
        return Camera(self.computer, driver, ppm=draw.choice((0.0, 0.0, 30.0, -80.0)))

    def usual_commit_s(self) -> float:
        """Of a disk that has nothing else to do."""
        return 0.001 + self.draw.random() * 0.008

    def live(self) -> None:
        """From the first start to the audit; in the world's first thread."""
        computer = self.computer
        computer.time_jumped()
        computer.disk.begin(self.draw)
        computer.commit_s = self.usual_commit_s
        WorldJob.begun, WorldJob.done = self._begun, self._done
        self.start_again()
        computer.sleep(2.0)
        self.levels = levels(self)
        for client in (Operator, Page, Researcher):
            self._begin(client)
        self._storm()
        self.is_calm = True
        self._let_pass(CALM_S)
        self.record.lies += audit(self)
        self.stop()
        self.record.lies += still_open(self)

    def _storm(self) -> None:
        end_ns = self.computer.now_ns + round(self.storm_s * 1e9)
        self._meet(self.faults, STORM_S * 0.3)
        self._let_pass(STORM_S)
        while self.computer.now_ns < end_ns:
            self._let_calm_down()
            self.megabytes.append(_megabytes())
            self._meet(self.draw.choice(PAIRS), 12.0)
            self._let_pass(self.draw.uniform(0.5, 1.5) * BETWEEN_S)
        self._let_calm_down()

    def _meet(self, faults: tuple[str, ...], after_s: float) -> None:
        self._due += len(faults)
        for fault in faults:
            self.computer.spawn(lambda fault=fault: self._happen(fault, after_s), fault, is_daemons=False)

    def _let_calm_down(self) -> None:
        while self._weather_goes_on():
            self.computer.sleep(1.0)

    def _begin(self, client: type[Client]) -> None:
        one = client(self, random.Random(self.draw.random()))
        self.computer.spawn(one.run, client.__name__, is_daemons=False)  # type: ignore[attr-defined]

    def _happen(self, fault: str, after_s: float) -> None:
        draw = random.Random(self.draw.random())
        self.computer.sleep(after_s + draw.choice((draw.uniform(-12.0, 12.0), draw.uniform(-1.0, 1.0))))
        spell = Spell(fault, self.computer.now_ns)
        self.spells.append(spell)
        FAULTS[fault](self, draw)
        spell.end_ns = self.computer.now_ns

    def _weather_goes_on(self) -> bool:
        return sum(one.end_ns < NEVER_NS for one in self.spells) < self._due

    def _let_pass(self, seconds: float) -> None:
        end_ns = self.computer.now_ns + round(seconds * 1e9)
        while self.computer.now_ns < end_ns:
            self.computer.sleep(AGED_S)
            self.computer.disk.age()
            if self._until_lie:
                self.record.lies += audit_sealed(self)
                if self.record.lies:
                    raise Enough

    def is_quiet(self, begin_ns: int, end_ns: int) -> bool:
        """True if nothing went wrong in that time, nor in the minute before it, nor just after it."""
        return not any(
            one.begin_ns < end_ns + SOON_NS and one.end_ns > begin_ns - FORGOTTEN_NS for one in self.spells
        )

    def was(self, fault: str, at_ns: int) -> bool:
        """True if there was such a fault, then or a little before or after."""
        near = (one for one in self.spells if one.fault == fault)
        return any(one.begin_ns - SOON_NS < at_ns < one.end_ns + SOON_NS for one in near)

    # What weather does

    def crash(self, *, power_cut: bool, after_commits: int | None) -> None:
        """Kills the daemon now, or in one of its next commits."""
        computer = self.computer
        if after_commits is not None:
            computer.disk.crash_at(computer.disk.commits + after_commits)
            computer.controller = computer.current
            computer.block(computer.now_ns + 20 * 10**9)
            computer.controller = None
        self.record.crashes.append(Crash(computer.now_ns, power_cut))
        self.daemon.die(power_cut=power_cut)
        if power_cut:
            _new_boot()

    def stop(self) -> None:
        """As systemd does."""
        self.daemon.stop()

    def start_again(self) -> None:
        """As systemd does: until it is accepted."""
        while self.daemon.service is None and (error := self.daemon.start()) is not None:
            if not self._weather_goes_on():
                self.record.lies.append(f"the daemon does not start: {error}")
                return
            self.computer.sleep(2.0)

    # What the record needs

    def job(self, name: str) -> Job:
        """Its record."""
        return self.record.jobs.setdefault(name, Job(0))

    def _begun(self, name: str) -> None:
        self.job(name).begun_ns.append(self.computer.now_ns)

    def _done(self, name: str) -> None:
        self.job(name).done_ns.append(self.computer.now_ns)

    def before_deletion(self, name: str) -> None:
        """What is deleted is audited before."""
        self.record.lies += audit_capture(self, name)

    def look_at_files(self) -> None:
        """Keeps the digests of sealed files, and compares them with those of before."""
        for path in sorted((self.computer.disk.folder / "captures").glob("*.grab")):
            digest = hashlib.blake2b(path.read_bytes()).digest()
            if self.record.digests.setdefault(path.name, digest) != digest:
                self.record.lies.append(f"{path.name} was sealed, and has changed")
                self.record.digests[path.name] = digest


def _megabytes() -> float:
    """Memory of this process that is its own."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096 / 1e6


def _new_boot() -> None:
    number = int(runtime.BOOT_ID_FILE.read_text()) + 1
    runtime.BOOT_ID_FILE.write_text(f"{number:032d}")
    runtime.boot_id.cache_clear()


class _Shouts(logging.Handler):
    """Errors of the program itself, which it logs with where they were."""

    def __init__(self, shout: Callable[[str], None]) -> None:
        super().__init__(logging.ERROR)
        self._shout = shout

    def emit(self, record: logging.LogRecord) -> None:
        if record.exc_info and record.exc_info[0] is not None:
            self._shout(f"logged: {self.format(record)[-1200:]}")


def played(
    seed: int,
    faults: tuple[str, ...] | None = None,
    storm_s: float = STORM_S,
    *,
    until_lie: bool = False,
) -> Outcome:
    """Plays a seed, in a process that has played no other."""
    begin_s = time.process_time()
    base = Path(tempfile.mkdtemp(prefix="world-"))
    runtime.BOOT_ID_FILE = base / "boot"
    runtime.BOOT_ID_FILE.write_text(f"{1:032d}")
    runtime.boot_id.cache_clear()
    folder = base / "state"
    folder.mkdir()
    try:
        return _played(World(seed, folder, faults, storm_s, until_lie=until_lie), begin_s)
    finally:
        shutil.rmtree(base)


def _played(world: World, begin_s: float) -> Outcome:
    computer, lies = world.computer, world.record.lies
    handler, root = _Shouts(lies.append), logging.getLogger()
    root.handlers[:] = [handler]
    root.setLevel(logging.WARNING)
    begin_ns = computer.now_ns
    signal.signal(signal.SIGPROF, computer.give_up)
    signal.setitimer(signal.ITIMER_PROF, LONGEST_S * world.storm_s / STORM_S)
    with runtime.installed(computer):
        try:
            computer.run(world.live)
        except Deadlock as error:
            lies.append(f"deadlock: {error}")
        except Enough:
            pass
    signal.setitimer(signal.ITIMER_PROF, 0.0)
    computer.disk.end()
    computer.close_all()
    lies += [f"thread {name} has ended by {error!r}" for name, error in computer.failures]
    return Outcome(
        world.seed,
        world.faults,
        sum(one.truth.taken for one in world.cameras.values()),
        len(world.record.captures),
        len(world.record.jobs),
        computer.trace,
        tuple(dict.fromkeys(lies)),
        (computer.now_ns - begin_ns) / 1e9,
        time.process_time() - begin_s,
        (world.megabytes[len(world.megabytes) // 4], world.megabytes[-1]) if world.megabytes else (0.0, 0.0),
    )
