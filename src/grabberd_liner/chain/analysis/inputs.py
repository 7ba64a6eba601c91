"""Inputs of an analysis besides the points (paper 3.8).

None that describes the liner is ever assumed; vacuum that was recorded with the capture is taken from there.

reference: nominal                      or {field: 12}, or {phase: 0.4}: reference state of strain; a guided
                                        test also {capture: ID}, the mean of another one, of the still liner
material: {E_mpa: 3, wall_mm: 2.5, …}   or {zones: [{rows: [0, 8], E_mpa: …}, …]}
vacuum:
  pulsation: {kpa: 0, sigma_kpa: 0.5}   or {rate_per_min: 60, ratio: 0.6, …}, or log, or channel
  liner: {kpa: 42, sigma_kpa: 0.5}      or log, or channel: recorded with the capture itself; {channel: NAME}
                                        where it has several that could be it
  log: "time_s,pulsation_vacuum_kpa…"   the text of a logger's file
  offset: {s: 12.3, sigma_s: 0.005}     the camera's time less the logger's, or light: both have seen it; with
                                        channels a correction of their clock, or light: one of them
  gauge_sigma_kpa: 0.2                  σ of a logger's zero, for a ramp; in place of that of channels
  lag: {opening_s: 0.03, closing_s: 0.03, sigma_s: 0.005, near_s: 12}   in place of offset
teat: none                              the liner is empty: a ramp of the vacuum, for the liner's own values
plane: symmetry                         or {point_mm: [0, 0, -9], normal: [0, 0, 1]}: origin of widths
heights_mm: [-30, 0, 30]
phases: 24                              number of states of the mean cycle
sought_kpa: 1                           smallest pressure that the map has to resolve; by default 5
unseen: free                            or mirrored: the half of the wall that no camera sees
flow_stop: {kpa: 40, sigma_kpa: 4}      contact pressure at the teat's end at which milk just stops flowing
milk_flow: high                         or low: what the capture's own channel flow reads while milk flows
agreement: {table: "…", state: greatest, …}   pressures by another method; see `read_other_method`
average: 10                             fields of a still wall that become one, their mean; n counts the means
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from grabberd.core.geometry import Reading
from grabberd.errors import InputError
from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.grid import Grid
from grabberd_liner.analysis.load.pressure import UNSEEN
from grabberd_liner.analysis.surface.sections import Plane, symmetry_plane
from grabberd_liner.analysis.vacuum.milk_flow import FlowCurve
from grabberd_liner.analysis.vacuum.vacuum import ChannelCurve
from grabberd_liner.analysis.wall.material import Zone, read_zones
from grabberd_liner.chain.analysis.agreement import OtherMethod, read_other_method

KEYS = (
    "reference",
    "material",
    "vacuum",
    "teat",
    "plane",
    "heights_mm",
    "phases",
    "sought_kpa",
    "unseen",
    "flow_stop",
    "milk_flow",
    "agreement",
    "average",
)
CHAMBERS = ("pulsation", "liner")
"""Chambers whose vacuum an analysis takes."""
CHANNEL = "channel"
"""Stands for a vacuum that was recorded with the capture itself."""
FLOW = "flow"
"""Channel of a sensor of flow, light or conductivity in the short milk tube."""
FLOWING = ("high", "low")
"""What it may read while milk flows."""
SOUGHT_KPA = 5.0
"""Default of `sought_kpa`: the map's own error at a place, on solved walls. A lesser pressure could not be
told from none."""
_VACUUM_KEYS = (*CHAMBERS, "log", "offset", "lag", "gauge_sigma_kpa")
_LEAST_READINGS = 10
BY_LIGHT = "light"
"""Of `vacuum.offset`: the clocks are related by the light in the picture and in the log."""
_HINT = "correct these inputs; docs/howto/analyse.md describes all of them"
# Time and memory of an analysis grow with the phases.
MOST_PHASES = 200
DEFAULT_PHASES = 24
_NOT_HOMOLOGOUS = (
    "homologous: the object's targets are other points of the wall in every field, so there are no strain, "
    "tension, pressure, movement and mean cycle; surface, sections and curvature are those of the outer face"
)


@dataclass(frozen=True, slots=True)
class Reference:
    """Reference state of the strain: nominal shape, a field, a phase of the mean cycle, or a capture."""

    kind: str
    value: float = 0.0
    capture: str = ""

    def __str__(self) -> str:
        if self.kind == "nominal":
            return "the object model's nominal shape"
        if self.kind == "capture":
            return f"capture {self.capture}"
        return (
            f"field {self.value:.0f}" if self.kind == "field" else f"phase {self.value:g} of the mean cycle"
        )


@dataclass(frozen=True, slots=True, eq=False)
class AnalysisInputs:
    """Validated inputs of an analysis.

    Attributes:
        given: the input document itself, for the record.
        reference: reference state; None: no strain is computed.
        zones: material zones of the wall; empty: no tension.
        vacuum: vacuum inputs; empty: no pressure.
        plane: origin of widths; None: no widths unless the targets go all the way round.
        heights_mm: heights of the sections, x in the object's frame.
        phases: number of states of the mean cycle.
        sought_kpa: smallest pressure that the map has to resolve.
        unseen: what the pressure takes for the unseen half of the wall, as in `PressureModel`.
        empty: True if the capture is a ramp with the empty liner: its own values in place of pressures.
        homologous: as in the grid; if False, reference and material have no use.
        flow_stop_kpa: contact pressure at the teat's end at which milk just stops flowing; None: no
            overpressure by the map.
        milk_flow: recorded flow in the short milk tube; None: no overpressure by milk flow.
        channels: what was recorded with the capture itself, by name.
        other_method: that the pressure is compared with; None: there is none.
        average: number of fields that become one, their mean; 1 leaves them as they are.
        unmet: what profiles and recorded channels could not give, in sentences.
        taken: chambers whose recorded channel was taken without being asked for.
    """

    given: Mapping[str, Any]
    reference: Reference | None
    zones: tuple[Zone, ...]
    vacuum: Mapping[str, Any]
    plane: Plane | None
    heights_mm: tuple[float, ...]
    phases: int
    sought_kpa: float = SOUGHT_KPA
    unseen: str = "free"
    empty: bool = False
    homologous: bool = True
    flow_stop_kpa: Estimate | None = None
    milk_flow: FlowCurve | None = None
    channels: Mapping[str, ChannelCurve] = field(default_factory=dict)
    other_method: OtherMethod | None = None
    average: int = 1
    unmet: tuple[str, ...] = ()
    taken: frozenset[str] = frozenset()

    @property
    def assumed(self) -> dict[str, str]:
        """Defaults of inputs that were not given, by their names, with where each comes from."""
        if not self.zones:
            return {}
        stated, material = self.given.get("material"), self.zones[0].material
        given = {*self.given, *(f"material.{key}" for key in stated or ())}
        defaults = {
            "material.radius_mm": f"{material.radius_mm:.4g} mm, from the object model",
            "material.law": f"{material.law}, as the equilibrium has it",
            "material.poisson": f"{material.poisson:g}: the law {material.law} keeps the volume",
        }
        if not self.empty:
            defaults["sought_kpa"] = f"{self.sought_kpa:g} kPa by default, the map's own error at a place"
        whole = isinstance(stated, Mapping) and "zones" not in stated
        return {
            name: said
            for name, said in defaults.items()
            if name not in given and (whole or not name.startswith("material"))
        }

    @property
    def lacks(self) -> tuple[str, ...]:
        """Missing inputs, each with the results that need it, after what could not be taken by itself."""
        return self.unmet + self._missing

    @property
    def _missing(self) -> tuple[str, ...]:
        plane = (
            self.plane is None,
            "plane: without it no widths and volume of a liner that is seen from one side",
        )
        if not self.homologous:
            return tuple(text for lacks, text in ((True, _NOT_HOMOLOGOUS), plane) if lacks)
        missing = (
            (self.reference is None, "reference: without it no strain, tension and pressure"),
            (
                not self.zones,
                "material: without it strain is that of the outer face, no tension and pressure",
            ),
            (
                bool(self.zones) and self.zones[0].material.ends_mm is None,
                "material.first_end_mm, material.last_end_mm: without them no pressure",
            ),
            ("pulsation" not in self.vacuum, "vacuum.pulsation: without it no pressure"),
            ("liner" not in self.vacuum, "vacuum.liner: without it no pressure"),
            plane,
            (
                self.flow_stop_kpa is None and not self.empty,
                "flow_stop: without it no overpressure by the map",
            ),
        )
        return tuple(text for lacks, text in missing if lacks)


class _Stated(NamedTuple):
    """The inputs that can be read without the object model."""

    reference: Reference | None
    material: Mapping[str, object]
    vacuum: Mapping[str, Any]
    plane: Plane | str | None
    heights_mm: tuple[float, ...] | None
    phases: int
    sought_kpa: float
    unseen: str
    flow_stop_kpa: Estimate | None
    milk_flow: str | None
    empty: bool
    average: int
    other_method: OtherMethod | None


def read_inputs(
    document: Mapping[str, Any], grid: Grid, channels: Mapping[str, ChannelCurve] | None = None
) -> AnalysisInputs:
    """The inputs from a document.

    Args:
        document: the document.
        grid: target grid of the object model.
        channels: what was recorded with the capture itself, by name.

    Raises:
        InputError: a key is unknown or has the wrong type; the message lists every problem.
        AnalysisError: `plane: symmetry` for an object without a symmetry plane.
    """
    reading = Reading("the analysis' inputs")
    stated = _stated(reading, document)
    reading.finish(_HINT)
    return AnalysisInputs(
        given=document,
        reference=stated.reference,
        zones=read_zones(stated.material, grid) if stated.material else (),
        vacuum=stated.vacuum,
        plane=symmetry_plane(grid) if isinstance(stated.plane, str) else stated.plane,
        heights_mm=_usual_heights(grid) if stated.heights_mm is None else stated.heights_mm,
        phases=stated.phases,
        sought_kpa=stated.sought_kpa,
        unseen=stated.unseen,
        empty=stated.empty,
        homologous=grid.homologous,
        flow_stop_kpa=stated.flow_stop_kpa,
        milk_flow=_milk_flow(stated.milk_flow, channels or {}),
        channels=channels or {},
        other_method=stated.other_method,
        average=stated.average,
    )


def input_problems(document: Mapping[str, Any]) -> list[str]:
    """Problems of inputs that show without an object model; those inside material and vacuum do not."""
    reading = Reading("the analysis' inputs")
    _stated(reading, document)
    return reading.problems


def _stated(reading: Reading, document: Mapping[str, Any]) -> _Stated:
    reading.keys("", document, KEYS)
    reference = _reference(reading, document.get("reference"))
    vacuum = _vacuum(reading, document.get("vacuum"))
    plane = _plane(reading, document.get("plane"))
    heights = _heights(reading, document.get("heights_mm"))
    phases = reading.integer(document, "phases", least=2) if "phases" in document else DEFAULT_PHASES
    if phases > MOST_PHASES:
        reading.refuse("phases", phases, f"at most {MOST_PHASES}")
    sought = reading.number(document, "sought_kpa", positive=True) if "sought_kpa" in document else SOUGHT_KPA
    unseen = reading.text(document, "unseen") if "unseen" in document else UNSEEN[0]
    if unseen not in UNSEEN:
        reading.refuse("unseen", unseen, " or ".join(UNSEEN))
    flow_stop = _flow_stop(reading, document.get("flow_stop"))
    milk_flow = reading.text(document, "milk_flow") if "milk_flow" in document else None
    if milk_flow is not None and milk_flow not in FLOWING:
        reading.refuse("milk_flow", milk_flow, " or ".join(FLOWING))
    empty = _empty(reading, document)
    average = reading.integer(document, "average", least=1) if "average" in document else 1
    material = reading.mapping(document, "material") if "material" in document else {}
    other = read_other_method(reading, document.get("agreement"))
    return _Stated(
        reference,
        material,
        vacuum,
        plane,
        heights,
        phases,
        sought,
        unseen,
        flow_stop,
        milk_flow,
        empty,
        average,
        other,
    )


def _empty(reading: Reading, document: Mapping[str, Any]) -> bool:
    if "teat" in document and document["teat"] != "none":
        reading.refuse("teat", document["teat"], "none, or no such key for a liner with a teat")
    return document.get("teat") == "none"


def _reference(reading: Reading, value: object) -> Reference | None:
    expected = "nominal, {field: n}, {phase: 0…1} or {capture: ID}"
    if value is None:
        return None
    if value == "nominal":
        return Reference("nominal")
    if not isinstance(value, Mapping) or len(value) != 1 or not {"field", "phase", "capture"} & set(value):
        reading.refuse("reference", value, expected)
        return None
    if "capture" in value:
        return Reference("capture", capture=reading.text(value, "capture", "reference."))
    if "field" in value:
        return Reference("field", reading.integer(value, "field", "reference.", least=0))
    phase = reading.number(value, "phase", "reference.")
    if not 0 <= phase < 1:
        reading.refuse("reference.phase", phase, "from 0 to less than 1")
    return Reference("phase", phase)


def _vacuum(reading: Reading, value: object) -> Mapping[str, Any]:
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        reading.refuse("vacuum", value, f"a mapping of {', '.join(_VACUUM_KEYS)}")
        return {}
    reading.keys("vacuum.", value, _VACUUM_KEYS)
    value = {key: CHANNEL if is_channel(one) else one for key, one in value.items()}
    recorded = CHANNEL in (value.get("pulsation"), value.get("liner"))
    if value.get("offset") == BY_LIGHT and "log" not in value and not recorded:
        reading.problems.append(
            f"vacuum.offset: {BY_LIGHT} needs vacuum.log, with a column light, or recorded channels"
        )
    if "offset" in value and "lag" in value:
        reading.problems.append("vacuum: offset and lag are both given; give one of them")
    return value


def is_channel(value: object) -> bool:
    """True for a vacuum that was recorded with the capture: `channel`, or {channel: NAME}."""
    return value == CHANNEL or (isinstance(value, Mapping) and set(value) == {CHANNEL})


def channel_of(chamber: str, value: object, recorded: Sequence[str]) -> str:
    """Name of the channel that an input of a chamber means.

    Args:
        chamber: The chamber.
        value: The input, for which `is_channel` is true.
        recorded: Names of the capture's channels that measure that chamber's vacuum.

    Raises:
        InputError: There is none, or none of that name, or several could be meant.
    """
    known = " and ".join(recorded) or "none"
    if not isinstance(value, Mapping) and len(recorded) > 1:
        raise InputError(f"vacuum.{chamber}: {unclear(chamber, recorded)}", "name the right one")
    name = value[CHANNEL] if isinstance(value, Mapping) else "".join(recorded)
    if name not in recorded:
        said = f" {name}" if name else ""
        raise InputError(
            f"vacuum.{chamber} is to come from the capture's own channel{said}, and it has none",
            f"its channels of it: {known}; name one of them, or give the vacuum as a log or a constant",
        )
    return str(name)


def unclear(chamber: str, recorded: Sequence[str]) -> str:
    """Sentence for a chamber of which several channels could be the vacuum."""
    return (
        f"the channels {' and '.join(recorded)} of this capture could each be it; name the right one, as in "
        f"vacuum: {{{chamber}: {{channel: {recorded[0]}}}}}"
    )


def _flow_stop(reading: Reading, value: object) -> Estimate | None:
    if value is None:
        return None
    if not isinstance(value, Mapping):
        reading.refuse("flow_stop", value, "a mapping of kpa and sigma_kpa")
        return None
    reading.keys("flow_stop.", value, ("kpa", "sigma_kpa"))
    numbers = [reading.number(value, key, "flow_stop.", positive=True) for key in ("kpa", "sigma_kpa")]
    return Estimate(*map(np.asarray, numbers))


def _milk_flow(flowing: str | None, channels: Mapping[str, ChannelCurve]) -> FlowCurve | None:
    """The recorded flow, higher while milk flows.

    Raises:
        InputError: the capture has no such channel, or too few readings of it.
    """
    if flowing is None:
        return None
    if FLOW not in channels or np.isfinite(channels[FLOW].kpa).sum() < _LEAST_READINGS:
        raise InputError(
            f"milk_flow is {flowing}, and the capture has no readings of a channel {FLOW}",
            "record the sensor in the short milk tube as a channel of the quantity flow, or leave it out",
        )
    curve = channels[FLOW]
    known = np.isfinite(curve.kpa)
    return FlowCurve(curve.time_s[known], curve.kpa[known] * (1 if flowing == "high" else -1))


def _plane(reading: Reading, value: object) -> Plane | str | None:
    if value is None or (isinstance(value, str) and value == "symmetry"):
        return value
    if not isinstance(value, Mapping):
        reading.refuse("plane", value, "symmetry, or a mapping of point_mm and normal")
        return None
    point = reading.numbers(value.get("point_mm"), "plane.point_mm", (3,))
    normal = reading.numbers(value.get("normal"), "plane.normal", (3,))
    if not np.any(normal):
        reading.refuse("plane.normal", value.get("normal"), "a direction, not all zeros")
    return Plane(point, normal)


def _heights(reading: Reading, value: object) -> tuple[float, ...] | None:
    if value is None:
        return None
    count = len(value) if isinstance(value, list | tuple) else 0
    return tuple(sorted(map(float, reading.numbers(value, "heights_mm", (count or 1,)))))


def _usual_heights(grid: Grid) -> tuple[float, ...]:
    """Three heights over the middle half of the liner."""
    low, high = np.quantile(grid.nominal_mm[:, 0], (0.25, 0.75))
    return float(low), float((low + high) / 2), float(high)


def missing(what: str, hint: str) -> InputError:
    """An input is missing that another one requires."""
    return InputError(f"the analysis' inputs lack {what}", hint)
