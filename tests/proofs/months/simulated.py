"""The plan, done to the daemon on simulated grabbers: one that fails in a long capture, one beside it."""

import signal
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from tests.proofs.faults.daemon import PATIENCE_S, Answer, Daemon
from tests.proofs.faults.evidence import Evidence, evidence_of
from tests.proofs.faults.failing import INJECTED, configuration
from tests.proofs.faults.judging import of_the_machine, problems_of
from tests.proofs.faults.machine import Machine
from tests.proofs.faults.observer import Observer, observing
from tests.proofs.faults.playing import Shortage, play
from tests.proofs.faults.suffering import BEFORE_S, PERIOD_S, Act, judged, recovered

from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.state.state_keeper import STATE, accept_state
from grabberd.errors import GrabberdError

from .log import Lived, Played
from .plan import Life

GRABBER, CUP = "grabber", "cup"
AFTER_S = 2.0
"""After an act, until something is done to the machine; after the last one, until its capture ends."""
SLACK_S = 10.0
"""After an act, until its losses have to be over."""
CUT_AFTER = 100
LOST_AT_MOST_S, COMMIT_S = 1.0, 1.0
"""What a kill may cost, and for how much longer a commit may take on this computer."""
ALARMS_S = 30.0

Tell = Callable[[Played | Lived], None]


NAME_A_DEVICE = {("/api/v1/captures", "POST"), ("/api/v1/settings", "PUT")}


class TwoDevices(Daemon):
    """A daemon with two devices; what needs one of them is about the second where nobody says otherwise."""

    def ask(self, path: str, method: str = "GET", document: Mapping[str, Any] | None = None) -> Answer:
        """One request and its answer, whatever that is."""
        if (path, method) in NAME_A_DEVICE:
            document = {"device": CUP, **(document or {})}
        return super().ask(path, method, document)


class Months:
    """One daemon after the other, in one folder of state."""

    def __init__(self, folder: Path, tell: Tell) -> None:
        self._folder, self._tell, self._begin_s = folder, tell, time.monotonic()
        folder.mkdir(parents=True, exist_ok=True)
        self._controls = folder / "controls.json"
        self._controls.write_text("{}")

    def live(self, number: int, life: Life) -> None:
        """Starts a daemon, does to it what the plan says, ends it, and looks at all it left."""
        cue, shortage = self._folder / f"cue-{number}", Shortage()
        with self._started(_configuration(life, cue)) as daemon:
            suffering = _Suffering(Machine(daemon, self._controls), self._since_begin, self._tell)
            with observing(daemon.port) as observer:
                suffering.play_beside(life, cue, observer)
            suffering.play_alone(life)
            suffering.check_alarms()
            suffering.end(life.end)
        lived = self._settled(life, suffering)
        self._tell(replace(lived, was_busy=shortage.was_there))

    @contextmanager
    def _started(self, config: Mapping[str, Any]) -> Iterator[TwoDevices]:
        """A daemon that is gone at the end, whatever happened."""
        daemon = TwoDevices(self._folder, config, INJECTED, {"FAULTS_CONTROLS": str(self._controls)})
        try:
            daemon.wait_until_ready()
            yield daemon
        finally:
            if daemon.process.poll() is None:
                daemon.process.kill()
                daemon.process.wait()

    def _settled(self, life: Life, suffering: "_Suffering") -> Lived:
        """Another daemon seals what is left; every file is looked at, and makes room for those to come."""
        with self._started(configuration()) as daemon:
            code = daemon.end()
        problems = [*suffering.problems]
        if code not in (0, -signal.SIGTERM):
            problems.append(f"the one after it ended with {code}")
        fields: Counter[str] = Counter()
        files = sorted(path for path in daemon.captures.rglob("*.grab*") if path.is_file())
        for file in files:
            try:
                evidence = evidence_of(file)
            except GrabberdError as error:
                problems.append(f"{file.name}: {error}")
                continue
            problems += [f"{file.name}: {said}" for said in (*evidence.problems, *suffering.of_cut(file))]
            fields.update({str(name): count for name, count in evidence.ledger.counts().items()})
            file.unlink()
        return Lived(
            life.end,
            self._since_begin(),
            len(files),
            dict(fields),
            suffering.memory_mb,
            suffering.descriptors,
            problems,
        )

    def _since_begin(self) -> float:
        return time.monotonic() - self._begin_s


class _Suffering:
    """What one daemon suffers; `problems` that belong to no single fault, memory and files at each fault."""

    def __init__(self, machine: Machine, now_s: Callable[[], float], tell: Tell) -> None:
        self._machine, self._daemon, self._now_s, self._tell = machine, machine.daemon, now_s, tell
        self._cut: tuple[str, int] | None = None
        self.problems: list[str] = []
        self.memory_mb: list[float] = []
        self.descriptors: list[int] = []

    def play_beside(self, life: Life, cue: Path, observer: Observer) -> None:
        """The grabber's faults in one long capture, those of the machine between them."""
        daemon, began_s, shortage = self._daemon, self._now_s(), Shortage()
        capture_id = daemon.start_capture(device=GRABBER)
        time.sleep(BEFORE_S)
        cue.touch()
        cue_s = time.monotonic()
        for act, fault in zip(life.acts, life.beside, strict=True):
            time.sleep(max(0.0, cue_s + act.ends_s + AFTER_S - time.monotonic()))
            if fault is not None:
                self._play(fault)
            self._count()
        last_s = cue_s + life.acts[-1].ends_s
        observer.wait_for(GRABBER, lambda seen: recovered(seen, last_s) is not None, PATIENCE_S)
        time.sleep(AFTER_S)
        seen = observer.of(GRABBER)
        told = daemon.stop_capture(capture_id)
        evidence = self._machine.evidence(told)
        of_acts = judged(life.acts, cue_s, seen, told, evidence)
        for act, (_, suffered) in zip(life.acts, of_acts, strict=True):
            scenario = act.scenario
            self._tell(
                Played(
                    scenario.fault,
                    began_s + act.begins_s,
                    suffered.noticed_s,
                    suffered.recovered_s if suffered.noticed_s is not None else None,
                    problems_of(scenario, suffered),
                    shortage.was_there,
                )
            )
        self.problems += _unexplained(evidence, life.acts, cue_s)

    def play_alone(self, life: Life) -> None:
        """What would end a long capture."""
        for fault in life.alone:
            self._play(fault)
            self._count()

    def _play(self, fault: str) -> None:
        self._come_to_rest()
        at_s, shortage = self._now_s(), Shortage()
        found = play(fault, self._machine)
        problems = list(found.problems)
        self._tell(Played(fault, at_s, found.noticed_s, found.recovered_s, problems, shortage.was_there))

    def _come_to_rest(self) -> None:
        """The index is made, and no capture of the cup is left by a fault that was cut short."""
        until_s = time.monotonic() + PATIENCE_S
        while (answer := self._daemon.ask("/api/v1/captures")).status != 200:
            assert time.monotonic() < until_s, answer
            time.sleep(0.1)
        for one in answer.document["captures"]:
            if one["device"] == CUP and one["state"] in ("recording", "sealing"):
                self._daemon.stop_capture(one["id"])

    def _count(self) -> None:
        pid = self._daemon.process.pid
        with open(f"/proc/{pid}/statm") as statm:
            self.memory_mb.append(int(statm.read().split()[1]) * 4096 / 1e6)
        self.descriptors.append(len(list(Path(f"/proc/{pid}/fd").iterdir())))

    def check_alarms(self) -> None:
        """A person accepts what was recovered; then no alarm is left, and every device streams."""
        accept_state(self._daemon.captures.parent / STATE, self._daemon.captures)
        self._daemon.wait_until_ready()
        until_s = time.monotonic() + ALARMS_S
        while (state := self._daemon.get("/api/v1/state"))["faults"] and time.monotonic() < until_s:
            time.sleep(0.2)
        self.problems += [f"an alarm stays: {fault['message']}" for fault in state["faults"]]
        self.problems += [
            f"{name} goes on to say {device['cause']}"
            for name, device in state["devices"].items()
            if device["cause"]
        ]

    def end(self, how: str) -> None:
        """In order, or cut off in the midst of a capture."""
        if how == "told to end":
            if (code := self._daemon.end()) not in (0, -signal.SIGTERM):
                self.problems.append(f"it ended with {code}")
            return
        capture_id = self._daemon.start_capture()
        path = f"/api/v1/captures/{capture_id}"
        self._daemon.wait_for(path, lambda one: one["ledger"]["counts"]["received"] >= CUT_AFTER)
        self._cut = capture_id, time.monotonic_ns()
        self._daemon.process.send_signal(signal.SIGKILL)
        self._daemon.process.wait()

    def of_cut(self, file: Path) -> Iterator[str]:
        """What is wrong with the file of the capture that was cut off, if it is this one."""
        if self._cut is None or not file.name.startswith(self._cut[0]):
            return
        with CaptureReader(file) as reader:
            last_ns = max((one.time_ns for one in reader.received()), default=0)
            if reader.meta.complete:
                yield "it was cut off, and says it is complete"
        if (lost_s := (self._cut[1] - last_ns) / 1e9) > LOST_AT_MOST_S + COMMIT_S:
            yield f"the last {lost_s:.1f} s before it was cut off are missing"


def _configuration(life: Life, cue: Path) -> dict[str, Any]:
    """The machine's of `tests.proofs.faults`, and a grabber with the script of a life."""
    script = [fault for act in life.acts for fault in act.scenario.script_after(act.lead_s)]
    grabber = {
        "driver": "fake",
        "options": {"scene": "blank", "buffers": 32, "cue": str(cue), "faults": script},
        "ring": {"lines": "field"},
        "threshold": {"kind": "fixed", "value": 120},
    }
    config = configuration()
    return {**config, "devices": {**config["devices"], GRABBER: grabber}}


def _unexplained(evidence: Evidence, acts: Sequence[Act], cue_s: float) -> Iterator[str]:
    """Losses that are neither those of an act nor the computer's."""
    if evidence.camera_n is None:
        return
    windows = [(cue_s + act.begins_s - SLACK_S / 10, cue_s + act.ends_s + SLACK_S) for act in acts]
    for entry in evidence.ledger.entries:
        at_s = (evidence.camera_n + entry.first_n) * PERIOD_S
        if not of_the_machine(entry) and not any(begin <= at_s <= end for begin, end in windows):
            yield f"nothing explains {entry}"
