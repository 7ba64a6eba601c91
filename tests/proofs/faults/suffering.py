"""A scenario, played: several devices of one daemon, each with a fault of its own, captures through them."""

import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

from grabberd.config import shipped_configs
from grabberd_fake.faults import PERIOD_NS

from .daemon import PATIENCE_S, Daemon, running
from .evidence import Evidence, evidence_of
from .observer import Observer, Seen, observing
from .scenario import Scenario

BEFORE_S = 0.4
"""How long a capture has run when its device is given the cue for its script."""
CONFIGS = shipped_configs()
PERIOD_S = PERIOD_NS / 1e9
AFTER_S = 0.6
"""How long a capture goes on after its recovery."""
SHARED, QUIET_S = 3, 1.3
"""Over so many devices the short ones are dealt, so long after each other."""
SIDE_BY_SIDE, DAEMONS = 4, 2
"""So many devices of a daemon, and daemons at a time: the simulated grabber draws on two cores."""
STREAMING = ("ready", "capturing")


class Suffered(NamedTuple):
    """What became of a scenario.

    Attributes:
        seen: what the operator was shown from the fault's beginning on, before it the last one of before.
        noticed_s: until the operator was shown something of it; `recovered_s`: from its end until fields came
            again. None: never.
        capture: as HTTP tells of it; None: none began, and `refusal` says why.
        evidence: of its file.
        begin_s, end_s: of the fault, CLOCK_MONOTONIC.
        alone: whether nothing else happened to its device.
    """

    seen: tuple[Seen, ...]
    noticed_s: float | None
    recovered_s: float | None
    capture: dict[str, Any] | None = None
    refusal: str | None = None
    evidence: Evidence | None = None
    begin_s: float = 0.0
    end_s: float = 0.0
    alone: bool = True


class Act(NamedTuple):
    """A scenario, and when its script begins: seconds from its device's cue."""

    scenario: Scenario
    lead_s: float

    @property
    def begins_s(self) -> float:
        return self.scenario.begins_field(self.lead_s) * PERIOD_S

    @property
    def ends_s(self) -> float:
        return self.scenario.ends_field(self.lead_s) * PERIOD_S


Device = tuple[Act, ...]
"""What one device suffers in one capture, in turn."""


def devices_of(scenarios: Sequence[Scenario]) -> list[Device]:
    """Short ones that leave nothing behind share a device, every other one has its own."""
    alone = [(Act(one, 0.0),) for one in scenarios if not one.may_share]
    sharing = [one for one in scenarios if one.may_share]
    counted, silent = ([one for one in sharing if one.is_counted is wanted] for wanted in (True, False))
    rows = [silent, *(counted[first::SHARED] for first in range(SHARED))]
    return [*(tuple(_in_turn(row)) for row in rows if row), *alone]


def _in_turn(scenarios: Sequence[Scenario]) -> Iterator[Act]:
    lead_s = 0.0
    for one in scenarios:
        yield Act(one, lead_s)
        lead_s += one.lasts_s + QUIET_S


def configuration(devices: Sequence[Device], folder: Path) -> dict[str, Any]:
    """The daemon's; the cues are files in a folder."""
    return {"devices": {_name(one): _device(one, _cue(one, folder)) for one in devices}}


def _cue(device: Device, folder: Path) -> Path:
    return folder / f"{_name(device)}.cue"


def _name(device: Device) -> str:
    return device[0].scenario.name


def _device(device: Device, cue: Path) -> dict[str, Any]:
    script = [fault for act in device for fault in act.scenario.script_after(act.lead_s)]
    options = dict(device[0].scenario.options)
    if not device[0].scenario.from_start:
        options["cue"] = str(cue)
    measured = {
        "calibration": str(CONFIGS / "fake.calibration.json"),
        "object": str(CONFIGS / "objects" / "liner.yaml"),
    }
    return {
        **(measured if device[0].scenario.calibrated else {}),
        "driver": "fake",
        "options": {"scene": "blank", "buffers": 32, **options, "faults": script},
        "ring": {"lines": "field"},
        "threshold": {"kind": "fixed", "value": 120},
    }


def suffer_all(
    scenarios: Sequence[Scenario], folder: Path, daemons: int = DAEMONS, side_by_side: int = SIDE_BY_SIDE
) -> dict[str, Suffered]:
    """What became of every scenario, by name."""
    rows = _rows(devices_of(scenarios), side_by_side)
    with ThreadPoolExecutor(daemons) as pool:
        works = [pool.submit(suffer, row, folder / f"daemon-{number}") for number, row in enumerate(rows)]
        return {name: one for work in works for name, one in work.result().items()}


def _rows(devices: Sequence[Device], side_by_side: int) -> list[Sequence[Device]]:
    """The devices of each daemon."""
    by_itself = [[one] for one in devices if one[0].scenario.own_daemon]
    others = [one for one in devices if not one[0].scenario.own_daemon]
    starts = range(0, len(others), side_by_side)
    return [*(others[first : first + side_by_side] for first in starts), *by_itself]


def suffer(devices: Sequence[Device], folder: Path) -> dict[str, Suffered]:
    """What became of every scenario, by name, of devices side by side in one daemon."""
    with (
        running(folder, configuration(devices, folder)) as daemon,
        observing(daemon.port) as observer,
        ThreadPoolExecutor(len(devices)) as pool,
    ):
        works = [pool.submit(_play, one, daemon, observer) for one in devices]
        return {name: one for work in works for name, one in work.result().items()}


def _play(device: Device, daemon: Daemon, observer: Observer) -> dict[str, Suffered]:
    if device[0].scenario.from_start:
        return {_name(device): _at_start(device[0], daemon, observer)}
    return _in_the_midst(device, daemon, observer)


def _at_start(act: Act, daemon: Daemon, observer: Observer) -> Suffered:
    """The fault is there first: what comes of it, and whether a capture is whole after it."""
    name = act.scenario.name
    end_s = observer.of_start() + act.ends_s
    observer.wait_for(name, lambda seen: seen[-1].state["state"] in STREAMING, PATIENCE_S)
    seen = tuple(observer.of(name))
    answer = daemon.ask("/api/v1/captures", "POST", {"device": name, "fields": 25})
    if answer.status != 202:
        return Suffered(seen, 0.0, None, refusal=answer.document["detail"])
    told = daemon.sealed(answer.document["id"])
    evidence = evidence_of(daemon.take_home(told["id"], daemon.folder), told)
    return Suffered(seen, 0.0, max(0.0, seen[-1].at_s - end_s), told, None, evidence)


def _in_the_midst(device: Device, daemon: Daemon, observer: Observer) -> dict[str, Suffered]:
    name = _name(device)
    assert observer.wait_for(name, lambda seen: seen[-1].state["fields"]["received"] > 0, PATIENCE_S)
    capture_id = daemon.start_capture(device=name, **(device[0].scenario.capture or {}))
    time.sleep(BEFORE_S)
    _cue(device, daemon.folder).touch()
    cue_s, last = time.monotonic(), device[-1]
    begin_s, end_s = cue_s + last.begins_s, cue_s + last.ends_s
    limit_s = end_s + (last.scenario.recovered_within_s or 0) + PATIENCE_S / 4 - time.monotonic()
    observer.wait_for(name, lambda seen: _is_over(seen, begin_s, end_s, last.scenario), limit_s)
    time.sleep(AFTER_S)
    seen = observer.of(name)
    told = daemon.stop_capture(capture_id)
    evidence = evidence_of(daemon.take_home(capture_id, daemon.folder), told)
    return dict(judged(device, cue_s, seen, told, evidence))


def _is_over(seen: list[Seen], begin_s: float, end_s: float, scenario: Scenario) -> bool:
    """Whether fields come again, and what there was to notice has had its second."""
    since_s = max(begin_s + 1.2, end_s + 0.3)
    taken = seen[-1].state["recoveries"]
    if any(taken[rung] < count for rung, count in scenario.sees.steps.items()):
        return False
    return seen[-1].at_s > since_s and recovered(seen, since_s) is not None


def judged(
    device: Device, cue_s: float, seen: list[Seen], told: dict[str, Any], evidence: Evidence
) -> Iterator[tuple[str, Suffered]]:
    for act, following in zip(device, (*device[1:], None), strict=True):
        begin_s, end_s = cue_s + act.begins_s, cue_s + act.ends_s
        until_s = cue_s + following.begins_s if following else float("inf")
        before = [one for one in seen if one.at_s < begin_s][-1:]
        shown = (*before, *(one for one in seen if begin_s <= one.at_s < until_s))
        noticed_s = _noticed(shown)
        recovered_s = recovered(shown, end_s if noticed_s is None else max(end_s, noticed_s))
        yield (
            act.scenario.name,
            Suffered(
                shown,
                None if noticed_s is None else noticed_s - begin_s,
                None if recovered_s is None else recovered_s - end_s,
                told,
                evidence=evidence,
                begin_s=begin_s,
                end_s=end_s,
                alone=len(device) == 1,
            ),
        )


def _noticed(shown: Sequence[Seen]) -> float | None:
    """When something else was shown than before the fault, but for fields that come."""
    before = _told(shown[0])
    return next((one.at_s for one in shown[1:] if _told(one) != before), None)


def _told(seen: Seen) -> tuple[Any, ...]:
    device = seen.state
    troubles = {outcome: count for outcome, count in device["fields"].items() if outcome != "received"}
    return device["state"], device["cause"], device["signal"], troubles, device["recoveries"]


def recovered(shown: Sequence[Seen], since_s: float) -> float | None:
    """When fields came again, and the device was as it should be."""
    return next(
        (later.at_s for one, later in _pairs(shown) if later.at_s >= since_s and _flows(one, later)), None
    )


def _pairs(shown: Sequence[Seen]) -> Iterator[tuple[Seen, Seen]]:
    return pairwise(shown)


def _flows(before: Seen, after: Seen) -> bool:
    more = after.state["fields"]["received"] > before.state["fields"]["received"]
    return more and after.state["state"] in STREAMING
