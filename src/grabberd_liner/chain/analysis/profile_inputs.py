"""Profiles of a liner, a pulsator, a cup and a cow, the inputs of an analysis that the labels of a capture
find in them, and the check of these inputs before the points are looked at.

A profile's quantities are those of the analysis' inputs, under the same names and read by the same readers.
Checks tell all problems, not the first alone.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, NamedTuple

from grabberd.core.geometry.document_reader import is_number
from grabberd.errors import GrabberdError, InputError
from grabberd_liner.analysis.grid import Grid, NominalShape
from grabberd_liner.analysis.vacuum.vacuum_log import read_vacuum_log
from grabberd_liner.analysis.wall.material import Material, read_parts, read_zones
from grabberd_liner.chain.analysis.inputs import (
    BY_LIGHT,
    CHAMBERS,
    CHANNEL,
    FLOW,
    channel_of,
    input_problems,
    is_channel,
    unclear,
)
from grabberd_liner.chain.analysis.vacuum_inputs import read_constant, read_lag, read_offset, read_wave

CHOICES = ("reference", "plane", "heights_mm", "phases", "sought_kpa", "unseen")
"""Inputs that say how captures of a liner are analysed, rather than what the liner is."""
OBTAINED = ("E_mpa", "wall_mm", "radius_mm", "F0_n")
"""Values of a material that are worth nothing where nobody knows how they were obtained."""
_SIGMAS = ("E_sigma_mpa", "wall_sigma_mm", "F0_sigma_n")
_MATERIAL_KEYS = tuple(field.name for field in fields(Material))
_OF_A_CAPTURE = ("start_s", "start_sigma_s")


@dataclass(frozen=True, slots=True)
class Profile:
    """One version of a profile.

    Attributes:
        kind: `liner`, `pulsator`, `cup` or `cow`: the key of the label that finds it.
        name: Value of that label.
        version: Number from 1; a version never changes.
        sha256: SHA-256 of its content, in hexadecimal.
        content: Its document.
    """

    kind: str
    name: str
    version: int
    sha256: str
    content: Mapping[str, Any]

    def __str__(self) -> str:
        return f"{self.kind} profile {self.name}, version {self.version}"


def quantity_problems(content: Mapping[str, Any]) -> list[str]:
    """Problems of the quantities in a profile's document, all of them, each with its key."""
    if content.get("kind") == "liner":
        return list(_of_liner(content))
    if content.get("kind") == "pulsator":
        return list(_of_pulsator(content))
    return []


def _of_liner(content: Mapping[str, Any]) -> Iterator[str]:
    material, choices, obtained = (_mapping(content, key) for key in ("material", "analysis", "obtained"))
    if material is not None:
        yield from _of_material(material, obtained or {})
    for key in obtained or {}:
        if key not in _MATERIAL_KEYS:
            yield f"obtained.{key}: unknown key; known keys are {', '.join(_MATERIAL_KEYS)}"
    unknown = [key for key in choices or {} if key not in CHOICES]
    for key in unknown:
        yield f"analysis.{key}: unknown key; known keys are {', '.join(CHOICES)}"
    known = {key: value for key, value in (choices or {}).items() if key not in unknown}
    yield from (f"analysis.{problem}" for problem in input_problems(known))


def _of_material(material: Mapping[str, Any], obtained: Mapping[str, Any]) -> Iterator[str]:
    try:
        read_parts(material)
    except InputError as error:
        yield error.message
    for where, entry in _entries(material):
        yield from _lacking_sigmas(where, entry, _SIGMAS)
    stated = {key for _, entry in _entries(material) for key in entry} - {"zones"}
    for key in OBTAINED:
        if key in stated and key not in obtained:
            yield f"obtained.{key}: is missing, expected how it was obtained: data sheet, calliper, ramp, …"


def _mapping(content: Mapping[str, Any], key: str) -> Mapping[str, Any] | None:
    value = content.get(key)
    return value if isinstance(value, Mapping) else None


def _of_pulsator(content: Mapping[str, Any]) -> Iterator[str]:
    pulsation, liner = content.get("pulsation"), content.get("liner")
    if isinstance(pulsation, Mapping):
        for key in _OF_A_CAPTURE:
            if key in pulsation:
                yield f"pulsation.{key}: belongs to a capture, not to a pulsator"
        try:
            read_wave({key: value for key, value in pulsation.items() if key not in _OF_A_CAPTURE})
        except InputError as error:
            yield error.message
        yield from _lacking_sigmas("pulsation.", pulsation, ("sigma_kpa",))
    if isinstance(liner, Mapping):
        try:
            read_constant("liner", liner)
        except InputError as error:
            yield error.message
        yield from _lacking_sigmas("liner.", liner, ("sigma_kpa",))


def _entries(material: Mapping[str, Any]) -> list[tuple[str, Mapping[str, Any]]]:
    """The parts of a material, each with the beginning of its keys."""
    zones = material.get("zones")
    if zones is None:
        return [("material.", material)]
    if isinstance(zones, str) or not isinstance(zones, Sequence):
        return []
    return [(f"material.zones[{at}].", one) for at, one in enumerate(zones) if isinstance(one, Mapping)]


def _lacking_sigmas(where: str, entry: Mapping[str, Any], names: Sequence[str]) -> Iterator[str]:
    """Problems of σ: no value is known exactly, and a pressure from values without σ claims to be."""
    for name in names:
        value = entry.get(name)
        if value is None:
            yield f"{where}{name}: is missing, expected a σ above 0"
        elif is_number(value) and value <= 0:
            yield f"{where}{name}: is {value!r}, expected a σ above 0"


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
        recorded: Names of the channels that were recorded with it, by the quantity that they measure.
    """

    device: str | None
    object_model: str | None
    grid: Grid
    recorded: Mapping[str, Sequence[str]] = {}


@dataclass(slots=True)
class ResolvedInputs:
    """Inputs of an analysis, and where they come from.

    Attributes:
        inputs: The inputs, as `read_inputs` takes them.
        sources: Profile of each input that comes from one, by the input's name, such as `vacuum.liner`.
        used: Profiles that any of them comes from.
        lacks: Profiles, parts of them and channels that could not be taken, in sentences.
        taken: Chambers whose recorded channel was taken.
    """

    inputs: dict[str, Any]
    sources: dict[str, str] = field(default_factory=dict)
    used: list[Profile] = field(default_factory=list)
    lacks: list[str] = field(default_factory=list)
    taken: set[str] = field(default_factory=set)

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


def with_recorded(given: Mapping[str, Any], subject: Subject) -> ResolvedInputs:
    """The inputs that are given, completed by the vacuum that was recorded with the capture."""
    resolved = ResolvedInputs(dict(given))
    _take_recorded(resolved, subject.recorded)
    return resolved


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
    undecided = _take_recorded(resolved, subject.recorded)
    if liner := found.get("liner"):
        _take_liner(resolved, liner, subject, problems)
    if pulsator := found.get("pulsator"):
        known = {key: value for key, value in pulsator.content.items() if key not in undecided}
        pulsator = replace(pulsator, content=known)
        _take_known(resolved, pulsator, {"vacuum.liner": "liner"})
    _take_pulsation(resolved, pulsator, liner)
    if cup := found.get("cup"):
        problems += _of_another_cup(cup, subject)
        # A channel has its own gauge, and its calibration.
        if not any(map(is_channel, resolved.vacuum.values())):
            _take_known(resolved, cup, {"vacuum.gauge_sigma_kpa": "gauge_sigma_kpa"})
        if FLOW in subject.recorded:
            _take_known(resolved, cup, {"milk_flow": "milk_flow"})
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


def _take_recorded(resolved: ResolvedInputs, recorded: Mapping[str, Sequence[str]]) -> set[str]:
    """Takes the capture's own channels for the chambers of which nothing is given, where there is no log.

    Returns:
        Chambers that several channels could be of: none of them is taken.
    """
    vacuum = resolved.vacuum
    if {"log", "lag"} & vacuum.keys() or not isinstance(resolved.inputs.get("vacuum", {}), Mapping):
        return set()
    open_ones = {name for name in CHAMBERS if recorded.get(name) and name not in vacuum}
    undecided = {name for name in open_ones if len(recorded[name]) > 1}
    resolved.lacks += [
        f"vacuum.{name} channel: {unclear(name, recorded[name])}" for name in sorted(undecided)
    ]
    resolved.taken |= open_ones - undecided
    if resolved.taken:
        taken = {name: CHANNEL for name in CHAMBERS if name in resolved.taken}
        resolved.inputs["vacuum"] = {**vacuum, **taken}
    return undecided


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


_LOG = "log"


def check_inputs(document: Mapping[str, Any], grid: Grid, recorded: Mapping[str, Sequence[str]]) -> list[str]:
    """Problems of inputs in sentences; empty if an analysis can begin with them.

    Args:
        document: The inputs, completed.
        grid: Grid of the object model.
        recorded: Names of the channels that were recorded with the capture, by quantity.
    """
    problems = input_problems(document)
    material, vacuum = document.get("material"), document.get("vacuum")
    if isinstance(material, Mapping):
        problems += _refusals(lambda: read_zones(material, grid))
    if isinstance(vacuum, Mapping):
        problems += _of_vacuum(vacuum, recorded)
    return problems


def _of_vacuum(vacuum: Mapping[str, Any], recorded: Mapping[str, Sequence[str]]) -> Iterator[str]:
    for name in CHAMBERS:
        if name in vacuum:
            yield from _of_chamber(name, vacuum[name], vacuum, recorded)
    if _LOG in vacuum:
        yield from _refusals(lambda: read_vacuum_log(vacuum[_LOG]))
    if "lag" in vacuum:
        yield from _refusals(lambda: read_lag(vacuum))
    if vacuum.get("offset") != BY_LIGHT:
        yield from _refusals(lambda: read_offset(vacuum))


def _of_chamber(
    name: str, value: object, vacuum: Mapping[str, Any], recorded: Mapping[str, Sequence[str]]
) -> Iterator[str]:
    if is_channel(value):
        yield from _refusals(lambda: channel_of(name, value, recorded.get(name, ())))
    elif value == _LOG:
        if _LOG not in vacuum:
            yield f"vacuum.{name}: is to come from a logger's file, and there is none"
        elif not {"offset", "lag"} & vacuum.keys():
            yield "vacuum: neither offset nor lag relates the logger's clock to the camera's"
    elif not isinstance(value, Mapping):
        yield f"vacuum.{name}: is {value!r}, expected a constant, a pulsator's settings, log or channel"
    elif "rate_per_min" in value:
        yield from _refusals(lambda: read_wave(value))
    else:
        yield from _refusals(lambda: read_constant(name, value))


def _refusals(read: Callable[[], object]) -> list[str]:
    """Refusals of a reader, in its words."""
    try:
        read()
    except GrabberdError as error:
        return [error.message]
    return []
