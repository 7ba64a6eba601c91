"""One fault of a grabber, as a YAML file says it: what happens, and what has to come of it."""

from pathlib import Path
from typing import Annotated, Any, Literal, Self

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from grabberd.core.ledger import Outcome
from grabberd.documents.enums import DeviceState
from grabberd.instrument.device.recovery import Rung
from grabberd_fake import FakeOptions
from grabberd_fake.faults import FOREVER_S, Fault, Recoverable

FOLDER = Path(__file__).parent / "scenarios"
SHORT_S = 1.0
"""Faults up to this length may be played one after the other on one device."""
NOTICED_S, RECOVERED_S = 1.0, 3.0
"""What is wanted; a scenario may say otherwise."""

AtLeastAtMost = Annotated[tuple[int, int], Field(description="so many fields")]


class Part(BaseModel):
    """Unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Sees(Part):
    """What the operator is shown by the event stream, from the fault's beginning on.

    Attributes:
        states: these, in this order; others may come between.
        cause: words of a cause; `hint`: of what is said to be done about it.
        signal: what is said of the camera's signal meanwhile.
        steps: so often at the least, each step of recovery.
        node: under which the device is there in the end.
        buffers: how many fields the driver keeps in the end.
    """

    states: tuple[DeviceState, ...] = ()
    cause: str | None = None
    hint: str | None = None
    signal: Literal["present", "absent"] | None = None
    steps: dict[Rung, int] = {}
    node: str | None = None
    buffers: int | None = None


class Account(Part):
    """What the ledger says of the time of the fault.

    Attributes:
        fields: so many of every outcome; of those that are not named none.
        because: words of one of the reasons.
        ended_because: words of why the capture ended by itself; None: it goes on until it is stopped.
    """

    fields: dict[Outcome, AtLeastAtMost] = {}
    because: str | None = None
    ended_because: str | None = None

    @property
    def is_clean(self) -> bool:
        """Whether nothing is to be missing."""
        return not self.fields


class Scenario(Part):
    """A capture, and a fault in the midst of it.

    Attributes:
        name: of the file.
        fault: in words.
        script: the simulated grabber's faults; their times count from when the capture runs.
        options: further options of the simulated grabber.
        capture: what is asked for; None: the fault is there from the beginning, the capture comes after it.
        calibrated: the device has the calibration of its pictures, and is measured.
        own_daemon: no other device is in its daemon, whose work would count as the program's.
        refused: words of why no capture begins after it.
        noticed_within_s: None: nobody has to notice.
    """

    name: str
    fault: str
    script: list[dict[str, Any]] = Field(min_length=1)
    options: dict[str, Any] = {}
    capture: dict[str, Any] | None = {}
    refused: str | None = None
    calibrated: bool = False
    own_daemon: bool = False
    sees: Sees = Sees()
    ledger: Account = Account()
    noticed_within_s: float | None = NOTICED_S
    recovered_within_s: float | None = RECOVERED_S

    @model_validator(mode="after")
    def _can_be_played(self) -> Self:
        self.faults_after(0.0)
        if self.ledger.is_clean != (self.noticed_within_s is None) and self.capture is not None:
            raise ValueError("what costs fields has to be noticed, and nothing else")
        return self

    @property
    def from_start(self) -> bool:
        """Whether the fault is there before anything else."""
        return self.capture is None

    @property
    def lasts_s(self) -> float:
        """From its beginning to its end."""
        return (self.ends_field(0.0) - self.begins_field(0.0)) / 50

    @property
    def is_counted(self) -> bool:
        """Whether the driver's sequence shows all that is lost."""
        return all(fault.counted for fault in self.faults_after(0.0))

    @property
    def may_share(self) -> bool:
        """Whether others may follow on the same device: nothing is done about it, so nothing of it stays."""
        plain = not (self.options or self.capture or self.calibrated) and not self.from_start
        return plain and not self.sees.steps and not self.sees.node and self.lasts_s <= SHORT_S

    def script_after(self, lead_s: float) -> list[dict[str, Any]]:
        """The script, begun after a while."""
        return [{**entry, "at_s": entry["at_s"] + lead_s} for entry in self.script]

    def faults_after(self, lead_s: float) -> tuple[Fault, ...]:
        """The same as the simulated grabber reads it.

        Raises:
            ValueError: it cannot.
        """
        if any("at_s" not in entry for entry in self.script):
            raise ValueError("script: every fault needs at_s")
        return FakeOptions.read({**self.options, "faults": self.script_after(lead_s)}).faults

    def begins_field(self, lead_s: float) -> int:
        """The first field of the first fault."""
        return min(fault.first for fault in self.faults_after(lead_s))

    def ends_field(self, lead_s: float) -> int:
        """The field after the last one of the last fault; where only a step ends one, its beginning."""
        return max(fault.first + _lasts(fault) for fault in self.faults_after(lead_s))


def _lasts(fault: Fault) -> int:
    cleared = isinstance(fault, Recoverable) and fault.until != "time"
    return 0 if cleared or fault.fields > FOREVER_S else fault.fields


def read(path: Path) -> Scenario:
    """A scenario of a YAML file.

    Raises:
        ValueError: it says what no scenario says; with the file and every problem.
    """
    try:
        document = yaml.load(path.read_text(encoding="utf-8"), Loader=yaml.CSafeLoader)
        if not isinstance(document, dict):
            raise ValueError("it is no mapping of keys to values")
        return Scenario.model_validate({"name": path.stem, **document})
    except ValidationError as error:
        problems = "; ".join(f"{_place(each['loc'])}: {each['msg']}" for each in error.errors())
        raise ValueError(f"{path.name}: {problems}") from None
    except (yaml.YAMLError, ValueError) as error:
        raise ValueError(f"{path.name}: {error}") from None


def _place(location: tuple[int | str, ...]) -> str:
    return ".".join(map(str, location)) or "as a whole"


def all_of(folder: Path = FOLDER) -> list[Scenario]:
    """Every scenario of a folder, by name."""
    return [read(path) for path in sorted(folder.glob("*.yaml"))]
