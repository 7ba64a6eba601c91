"""Inputs of an analysis from profiles: what the labels of a capture find, where the inputs do not say it."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from grabberd.errors import InputError
from grabberd_liner.analysis import Grid
from grabberd_liner.analysis.surface.nominal_shape import NominalShape
from grabberd_liner.analysis.wall.material_document import read_parts
from grabberd_liner.chain.analysis.inputs import CHANNEL
from grabberd_liner.chain.analysis.profile import CHOICES, Profile

KINDS = ("liner", "pulsator", "cup", "cow")
_NEAREST_CYCLE_S = 0.0
"""All cycles of a pulsator's settings are alike: the one nearest to the capture's first field will do."""
_UNLIKE_RADIUS = 0.015
"""Share by which radii may differ: .2 mm.

The axis is that of the object model, and by what its radius is off, the gap between opposite walls is off:
with the object model of a liner that is 4 % wider, a ramp gave a touch of 21.5 instead of 14.9 kPa.
"""
_HINT = (
    "correct the profile (grabberd profile add), the capture's labels or its object model, or give these "
    "inputs themselves"
)


class Subject(NamedTuple):
    """A capture, as far as a profile can contradict it.

    Attributes:
        device: Name of the device that recorded it.
        object_model: Name of the object model that it was measured with.
        grid: Grid of that object model.
        recorded: Chambers whose vacuum was recorded with it, of `pulsation` and `liner`.
    """

    device: str | None
    object_model: str | None
    grid: Grid
    recorded: frozenset[str] = frozenset()


@dataclass(slots=True)
class ResolvedInputs:
    """Inputs of an analysis, and where they come from.

    Attributes:
        inputs: The inputs, as `read_inputs` takes them.
        sources: Profile of each input that comes from one, by the input's name, such as `vacuum.liner`.
        used: Profiles that any of them comes from.
        lacks: Profiles and parts of them that were looked for and are not there, in sentences.
    """

    inputs: dict[str, Any]
    sources: dict[str, str] = field(default_factory=dict)
    used: list[Profile] = field(default_factory=list)
    lacks: list[str] = field(default_factory=list)

    @property
    def vacuum(self) -> dict[str, Any]:
        """The vacuum so far; empty where there is none, or it is no mapping, which its reader refuses."""
        given = self.inputs.get("vacuum")
        return dict(given) if isinstance(given, Mapping) else {}

    def take(self, profile: Profile, name: str, value: Any) -> bool:
        """Takes an input from a profile, unless it is given; returns whether it was taken."""
        whole, _, part = name.partition(".")
        if part:
            if whole in self.inputs and not isinstance(self.inputs[whole], Mapping):
                return False
            holder = self.vacuum
            if part in holder:
                return False
            self.inputs[whole] = {**holder, part: value}
        elif whole in self.inputs:
            return False
        else:
            self.inputs[whole] = value
        self.sources[name] = str(profile)
        if profile not in self.used:
            self.used.append(profile)
        return True


def resolve(
    labels: Mapping[str, str], profiles: Sequence[Profile], given: Mapping[str, Any], subject: Subject
) -> ResolvedInputs:
    """The inputs that are given, completed by the profiles that the labels of the capture name.

    What is given wins: a material as a whole, a vacuum chamber by chamber. What was recorded with the capture
    comes next: it is of this very capture, and a profile tells what is usual.

    Args:
        labels: Labels of the capture; the label `liner` finds the liner's profile of that name, and so on.
        profiles: Profiles to choose from.
        given: Inputs that are given.
        subject: The capture.

    Raises:
        InputError: Profiles contradict the capture; the message lists everything that does.
    """
    found = {one.kind: one for one in profiles if labels.get(one.kind) == one.name}
    resolved = ResolvedInputs(dict(given), lacks=list(_not_found(labels, found)))
    problems: list[str] = []
    _take_recorded(resolved, subject.recorded)
    if liner := found.get("liner"):
        _take_liner(resolved, liner, subject, problems)
    if pulsator := found.get("pulsator"):
        _take_known(resolved, pulsator, {"vacuum.liner": "liner"})
    _take_pulsation(resolved, pulsator, liner)
    if cup := found.get("cup"):
        problems += _of_another_cup(cup, subject)
        if CHANNEL not in resolved.vacuum.values():  # a channel has its own gauge, and its calibration
            _take_known(resolved, cup, {"vacuum.gauge_sigma_kpa": "gauge_sigma_kpa"})
    if cow := found.get("cow"):
        _take_known(resolved, cow, {"flow_stop": "flow_stop"})
    if problems:
        raise InputError(f"profiles contradict the capture: {'; '.join(problems)}", _HINT)
    return resolved


def _not_found(labels: Mapping[str, str], found: Mapping[str, Profile]) -> Iterator[str]:
    if not any(kind in labels for kind in KINDS):
        yield f"profiles: the capture has none of the labels {', '.join(KINDS)}, so none was found"
    for kind in KINDS:
        if kind in labels and kind not in found:
            yield f"{kind} profile: none in use is called {labels[kind]!r}, as the label {kind} says"


def _take_recorded(resolved: ResolvedInputs, recorded: frozenset[str]) -> None:
    """Takes the capture's own channels for the chambers of which nothing is given, where there is no log."""
    vacuum = resolved.vacuum
    if "log" in vacuum:
        return
    channels = {name: CHANNEL for name in ("pulsation", "liner") if name in recorded and name not in vacuum}
    if channels:
        resolved.inputs["vacuum"] = {**vacuum, **channels}


def _take_known(resolved: ResolvedInputs, profile: Profile, keys: Mapping[str, str]) -> None:
    for name, key in keys.items():
        if (value := profile.content.get(key)) is not None:
            resolved.take(profile, name, value)


def _take_liner(resolved: ResolvedInputs, liner: Profile, subject: Subject, problems: list[str]) -> None:
    material = liner.content.get("material")
    if material is None and "material" not in resolved.inputs:
        resolved.lacks.append(f"material: the {liner} has none yet")
    elif material is not None and resolved.take(liner, "material", material):
        problems += _of_another_object(liner, material, subject.grid)
    choices = liner.content.get("analysis") or {}
    for name in CHOICES:
        if name in choices:
            resolved.take(liner, name, choices[name])


def _take_pulsation(resolved: ResolvedInputs, pulsator: Profile | None, liner: Profile | None) -> None:
    """Takes a pulsator's settings together with the wall's lag, which dates them: a profile cannot know when.

    Without it, a cycle would be taken to begin with the capture.
    """
    vacuum = resolved.vacuum
    # A log is of this very capture, and with an empty liner the vacuum is a ramp: settings are neither.
    said = {"pulsation", "log"} & vacuum.keys() or "teat" in resolved.inputs
    settings = pulsator.content.get("pulsation") if pulsator and not said else None
    undated = _is_undated(settings or vacuum.get("pulsation")) and "lag" not in vacuum
    lag = liner.content.get("lag") if liner else None
    if undated and liner and lag and not {"log", "offset"} & vacuum.keys():
        undated = not resolved.take(liner, "vacuum.lag", {**lag, "near_s": _NEAREST_CYCLE_S})
    if pulsator and settings and undated:
        resolved.lacks.append(
            f"vacuum.lag: without it nothing says when in the capture a cycle of the {pulsator} begins, so "
            "its settings are left out"
        )
    elif pulsator and settings:
        resolved.take(pulsator, "vacuum.pulsation", settings)


def _is_undated(pulsation: object) -> bool:
    return isinstance(pulsation, Mapping) and "rate_per_min" in pulsation and "start_s" not in pulsation


def _of_another_object(liner: Profile, material: Mapping[str, Any], grid: Grid) -> Iterator[str]:
    """Contradictions of a liner's material and the object model."""
    seen_mm, last_row = NominalShape.of(grid).radius_mm, int(grid.row.max())
    for rows, one in read_parts(material):
        outer_mm = one.radius_mm + one.depth_mm
        if seen_mm and abs(outer_mm / seen_mm - 1) > _UNLIKE_RADIUS:
            yield (
                f"{liner}: its targets lie {2 * outer_mm:.1f} mm apart across the liner (radius_mm, half of "
                f"wall_mm, and target_mm, twice), those of the object model {2 * seen_mm:.1f} mm"
            )
        if rows is not None and rows[1] > last_row:
            yield f"{liner}: a zone ends with row {rows[1]}, the object model with row {last_row}"


def _of_another_cup(cup: Profile, subject: Subject) -> Iterator[str]:
    """Contradictions of a cup and the capture's device and object model."""
    device, object_model = cup.content.get("device"), cup.content.get("object_model")
    if device is not None and subject.device is not None and device != subject.device:
        yield f"{cup}: it is of the device {device}, the capture was recorded by {subject.device}"
    if object_model is not None and object_model != subject.object_model:
        seen = subject.object_model
        yield f"{cup}: its object model is {object_model}, the capture was measured with {seen}"
