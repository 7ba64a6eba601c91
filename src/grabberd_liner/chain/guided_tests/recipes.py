"""The recipes of the guided tests: how a liner is captured for each, and what the operator does."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, NamedTuple

LABEL = "test"
"""Key of the capture's label whose value is the recipe, such as `test: ramp`."""
KNOWN_KPA, KNOWN_SIGMA_KPA = "known_kpa", "known_sigma_kpa"
"""Labels of a capture of the artificial teat: the pressure in it, and its σ."""
MILKINGS = "milkings"
"""Label of a capture: milkings that the liner had done by then."""
UNMOUNTED_PITCH_MM = "unmounted_pitch_mm"
"""Label of a capture: pitch of the rows of targets before the liner was mounted."""


class Step(NamedTuple):
    """A step of the operator: a name that never changes, and a sentence."""

    name: str
    text: str


@dataclass(frozen=True)
class Recipe:
    """Recipe of a guided test.

    Attributes:
        kind: name of the test, which is also the value of the label `test` of its captures.
        title: for people.
        duration_s: length of a capture.
        bits: bits per pixel of a capture.
        several: True if it evaluates several captures.
        pulsates: True if the pulsator runs during the capture, False if the wall stands still; None if it may
            do either.
        teat: True if there is a teat in the liner; None if there may be.
        steps: what the operator does, in order, before the capture is started.
        inputs: inputs of the analyses that follow from the steps; given ones and recorded channels win.
    """

    kind: str
    title: str
    duration_s: float
    bits: int
    several: bool
    pulsates: bool | None
    teat: bool | None
    steps: tuple[Step, ...]
    inputs: Mapping[str, Any] = field(default_factory=dict)


_STILL_S = 2.0
_AT_ATMOSPHERE = {"kpa": 0.0, "sigma_kpa": 0.2}
"""Both chambers without vacuum, as the steps say: the air may move by that much while a hose is open."""
_NO_VACUUM = {"pulsation": _AT_ATMOSPHERE, "liner": _AT_ATMOSPHERE}
_OF_STILL = {"reference": "nominal", "vacuum": _NO_VACUUM, "sought_kpa": 1.0, "average": 10}
_MOUNTED = Step("mount", "Mount the liner in its shell as for milking, flattening towards the camera.")

_ALL = (
    Recipe(
        "reference",
        "Reference state",
        _STILL_S,
        8,
        several=False,
        pulsates=False,
        teat=False,
        steps=(
            _MOUNTED,
            Step("no_teat", "Leave it empty: no teat, no plug."),
            Step("no_vacuum", "Open both hoses, so that pulsation chamber and liner have no vacuum."),
            Step("still", "Let nothing touch the cup while the capture runs."),
        ),
        inputs=_OF_STILL,
    ),
    Recipe(
        "ramp",
        "Ramp without a teat",
        60.0,
        8,
        several=False,
        pulsates=None,
        teat=False,
        steps=(
            _MOUNTED,
            Step("close", "Close the mouthpiece without a teat, so that the liner holds the vacuum."),
            Step("equal", "Give liner and pulsation chamber the same vacuum: the liner stands open."),
            Step("fall", "Start, and let the pulsation chamber's vacuum fall slowly, for a minute at least."),
            Step("touch", "Go on until opposite walls have touched; go slowest while the liner flattens."),
        ),
        inputs={"teat": "none", "reference": {"field": 0}},
    ),
    Recipe(
        "milking",
        "Milking",
        20.0,
        1,
        several=False,
        pulsates=True,
        teat=True,
        steps=(
            Step("attach", "Attach the cup to the teat, and wait until milk flows."),
            Step("pulsate", "Let the pulsator run while the capture runs."),
        ),
    ),
    Recipe(
        "artificial-teat",
        "Artificial teat with known pressure",
        _STILL_S,
        8,
        several=True,
        pulsates=False,
        teat=True,
        steps=(
            Step("reference", "Make the reference test first; its capture is evaluated with the others."),
            Step("insert", "Put the artificial teat into the mounted liner, filled with water, without air."),
            Step("no_vacuum", "Open both hoses, so that pulsation chamber and liner have no vacuum."),
            Step("zero", "Capture it at pressure 0 first: label known_kpa 0."),
            Step("up", "Raise the pressure in steps of 2 kPa (20 cm of water), one capture for each."),
            Step("down", "Repeat the same steps downwards, with the same labels."),
        ),
        inputs=_OF_STILL,
    ),
    Recipe(
        "overpressure",
        "Overpressure in two ways",
        40.0,
        1,
        several=True,
        pulsates=None,
        teat=True,
        steps=(
            Step("sensor", "Fit a sensor of milk flow into the short milk tube; record it as channel flow."),
            Step("attach", "Attach the cup to the teat, and wait for a minute of full milk flow."),
            Step("pulsate", "Capture some twenty cycles while the pulsator runs."),
            Step("hold", "Hold the pulsator in phase d, its chamber at atmosphere; start the next capture."),
            Step(
                "raise", "After five seconds raise the chamber's vacuum by .5 kPa a second until milk flows."
            ),
        ),
    ),
    Recipe(
        "wear",
        "Wear over milkings",
        20.0,
        1,
        several=True,
        pulsates=None,
        teat=None,
        steps=(
            Step("same", "Take the same liner, cup and place of the targets each time."),
            Step("repeat", "Repeat the ramp or the milking every few hundred milkings."),
            Step("count", "Label each capture with the milkings that the liner has done: label milkings."),
        ),
    ),
)

RECIPES: Mapping[str, Recipe] = MappingProxyType({one.kind: one for one in _ALL})
"""All recipes, by kind."""
