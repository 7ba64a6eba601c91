"""Account of a capture's channels: how many readings it has, where there are none, and what else came."""

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.channels.logger import Anomaly
from grabberd.errors import count_of

GAP_STEPS = 3.0
"""Steps between two readings from which on readings are missing; arrival may vary by less."""
MOST_LISTED = 100
"""Gaps of a channel, and kinds of anomalies of a capture, that are listed; further ones are counted."""
LONGEST_TEXT = 200
"""Characters of a reason or an example."""
SILENT = "no reading came"
OTHER = "other anomalies"
_STEPS = 200
"""Latest steps, whose median is the usual one."""


class Gap(NamedTuple):
    """A time without readings.

    Attributes:
        first_ns: The last reading before it, or the capture's first field.
        last_ns: The first reading after it, or the capture's last field.
        reason: A few words.
    """

    first_ns: int
    last_ns: int
    reason: str


class AnomalyCount(NamedTuple):
    """Anomalies of one logger for one reason.

    Attributes:
        logger: Name of the logger.
        reason: See `Anomaly`.
        times: How many there were.
        lost: Number of readings that are missing because of them, as far as that is known.
        time_ns: When the first was noticed.
        example: What was read then.
    """

    logger: str
    reason: str
    times: int
    lost: int
    time_ns: int
    example: str


class ChannelAccount(NamedTuple):
    """Readings of one channel in one capture.

    Attributes:
        name: Name of the channel.
        logger: Name of its logger.
        readings: Number of readings.
        first_ns: Time of the first; None if there is none.
        last_ns: Time of the last.
        step_ns: Usual time from one to the next; 0 while that is unknown.
        gaps: The first gaps in them, in order.
        gap_count: Number of all gaps.
        gap_ns: How long they are together.
        late: Why nothing came before the first reading, if something should have.
        silence: Why nothing has come since the last reading, if something should have.
    """

    name: str
    logger: str
    readings: int = 0
    first_ns: int | None = None
    last_ns: int | None = None
    step_ns: int = 0
    gaps: tuple[Gap, ...] = ()
    gap_count: int = 0
    gap_ns: int = 0
    late: str = SILENT
    silence: str = SILENT

    def closed(self, begin_ns: int, end_ns: int) -> "ChannelAccount":
        """The account with the gaps before its first and after its last reading.

        Args:
            begin_ns: Time of the capture's first field.
            end_ns: Time of its last.
        """
        if self.first_ns is None or self.last_ns is None:
            return self.with_gaps([Gap(begin_ns, max(begin_ns, end_ns), self.silence)])
        room_ns = GAP_STEPS * self.step_ns
        edges = (Gap(begin_ns, self.first_ns, self.late), Gap(self.last_ns, end_ns, self.silence))
        return self.with_gaps(edge for edge in edges if edge.last_ns - edge.first_ns > room_ns)

    def with_gaps(self, gaps: Iterable[Gap]) -> "ChannelAccount":
        """The account with further gaps."""
        new = list(gaps)
        listed = sorted((*self.gaps, *new[: max(MOST_LISTED - len(self.gaps), 0)]))
        gap_ns = self.gap_ns + sum(gap.last_ns - gap.first_ns for gap in new)
        return self._replace(gaps=tuple(listed), gap_count=self.gap_count + len(new), gap_ns=gap_ns)


class Account(NamedTuple):
    """The channels of one capture."""

    channels: tuple[ChannelAccount, ...]
    anomalies: tuple[AnomalyCount, ...] = ()

    @property
    def complete(self) -> bool:
        """True if no reading is missing, as far as anybody can tell."""
        whole = all(one.readings and not one.gap_count for one in self.channels)
        return whole and not any(one.lost for one in self.anomalies)

    @property
    def verdict(self) -> str:
        """In one or two words, "complete" or "with gaps"."""
        return "complete" if self.complete else "with gaps"

    @property
    def in_words(self) -> str:
        """The verdict with its reasons, for people."""
        said = [_gaps_in_words(one) for one in self.channels if one.gap_count or not one.readings]
        said += [f"{one.logger}: {one.times} × {one.reason}" for one in self.anomalies]
        return f"{self.verdict}: {'; '.join(said)}" if said else self.verdict


def _gaps_in_words(account: ChannelAccount) -> str:
    reasons = ", ".join(dict.fromkeys(gap.reason for gap in account.gaps)) or account.silence
    if not account.readings:
        return f"{account.name}: no readings at all ({reasons})"
    gaps = count_of(account.gap_count, "gap")
    return f"{account.name}: {gaps}, {account.gap_ns / 1e9:.2f} s ({reasons})"


@dataclass
class ChannelLedger:
    """Keeps the account of one channel while it is recorded.

    Attributes:
        account: The account so far.
    """

    account: ChannelAccount
    _steps_ns: deque[int] = field(default_factory=lambda: deque(maxlen=_STEPS))

    def interrupted(self, reason: str) -> None:
        """Notes why no readings come from now on; the first reason counts until one comes."""
        if self.account.silence == SILENT:
            self.account = self.account._replace(silence=reason[:LONGEST_TEXT])

    def resumed(self) -> None:
        """Notes that readings come again, though these do not belong to the capture."""
        self.account = self.account._replace(silence=SILENT)

    def enter(self, time_ns: NDArray[np.int64]) -> None:
        """Enters the times of further readings, ascending."""
        if not len(time_ns):
            return
        before = self.account
        times = time_ns if before.last_ns is None else np.concatenate(([before.last_ns], time_ns))
        steps = np.diff(times)
        self._steps_ns.extend(steps.tolist())
        usual_ns = int(np.median(self._steps_ns)) if self._steps_ns else 0
        long = np.flatnonzero(steps > GAP_STEPS * usual_ns).tolist() if usual_ns else []
        gaps = [Gap(int(times[k]), int(times[k + 1]), before.silence if k == 0 else SILENT) for k in long]
        self.account = before.with_gaps(gaps)._replace(
            readings=before.readings + len(time_ns),
            first_ns=int(time_ns[0]) if before.first_ns is None else before.first_ns,
            late=before.silence if before.first_ns is None else before.late,
            last_ns=int(time_ns[-1]),
            step_ns=usual_ns,
            silence=SILENT,
        )


class AnomalyLedger:
    """Counts anomalies by logger and reason."""

    def __init__(self) -> None:
        self._counts: dict[tuple[str, str], AnomalyCount] = {}

    @property
    def counts(self) -> tuple[AnomalyCount, ...]:
        """The counts, in the order of their first anomalies."""
        return tuple(self._counts.values())

    def enter(self, logger: str, anomalies: Sequence[Anomaly]) -> None:
        """Counts anomalies of one logger."""
        for one in anomalies:
            reason = one.reason[:LONGEST_TEXT]
            if (logger, reason) not in self._counts and len(self._counts) >= MOST_LISTED:
                reason = OTHER
            first = AnomalyCount(logger, reason, 0, 0, one.time_ns, one.example[:LONGEST_TEXT])
            known = self._counts.get((logger, reason), first)
            counted = known._replace(times=known.times + 1, lost=known.lost + one.lost)
            self._counts[logger, reason] = counted
