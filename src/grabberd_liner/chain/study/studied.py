"""Captures as a study takes them: what they are, and the quantities of their newest analyses."""

import math
import re
from collections.abc import Iterable, Mapping
from typing import NamedTuple

DEVICE, DATE, ID, VERDICT = "device", "date", "id", "verdict"
"""Names of what a capture has beside its labels."""
ALL = "all"
"""The only group of a study without groups."""


class Found(NamedTuple):
    """A quantity in an analysis.

    Attributes:
        unit: "1" for a ratio.
        value: in that unit; NaN if nothing was found.
        sigma: one standard deviation; NaN if it is not known.
        common: part of it that captures of the same liner share; None if the analysis does not tell.
        reason: why nothing was found.
    """

    unit: str
    value: float
    sigma: float
    common: float | None
    reason: str


NOTHING = Found("", math.nan, math.nan, None, "")


class Meaning(NamedTuple):
    """Title and definition of a quantity; empty if the analysis does not tell."""

    title: str
    definition: str


class Studied(NamedTuple):
    """A capture with its newest analysis.

    Attributes:
        id: of the capture.
        captured_utc: its start.
        device: name of its device; empty if that is not known.
        verdict: complete or incomplete; empty if that is not known.
        labels: those it has today, or those of its analysis.
        liner: the liner it was analysed for: a version of its profile, its label, or its material; captures
            of the same liner share the common part of σ. Empty if nothing tells.
        analysis: number of the analysis, or the folder that it is in.
        analysed_utc: when it was made.
        found: the quantities by name, in their order.
        meanings: of them, where they are known.
    """

    id: str
    captured_utc: str
    device: str
    verdict: str
    labels: Mapping[str, str]
    liner: str
    analysis: str
    analysed_utc: str
    found: Mapping[str, Found]
    meanings: Mapping[str, Meaning]

    def value_of(self, key: str) -> str:
        """Value of a capture under a name: its device, day, id, verdict or a label; empty if it has none."""
        known = {
            DEVICE: self.device,
            DATE: self.captured_utc[:10],
            ID: self.id,
            VERDICT: self.verdict,
        }
        return known[key] if key in known else self.labels.get(key, "")


def unanalysed(
    capture_id: str, captured_utc: str, device: str, verdict: str = "", *, labels: Mapping[str, str]
) -> Studied:
    """A capture before anything is known of its analysis."""
    return Studied(capture_id, captured_utc, device, verdict, labels, "", "", "", {}, {})


class LeftOut(NamedTuple):
    """A capture that a study does without, or one of its quantities, and why."""

    capture: str
    quantity: str
    reason: str


def natural(names: Iterable[str]) -> list[str]:
    """Names in the order in which people count: 2 before 10."""
    return sorted(set(names), key=_parts)


def _parts(name: str) -> list[tuple[int, int, str]]:
    parts = re.split(r"(\d+)", name)
    return [(0, int(part), part) if part.isdecimal() else (1, 0, part.casefold()) for part in parts if part]
