"""Every table and column of an analysis: name, unit and meaning, in one place."""

from collections.abc import Mapping
from typing import NamedTuple


class Definition(NamedTuple):
    """One column; a measured one has beside it a column `sigma_NAME` with its σ, in the same unit."""

    name: str
    unit: str
    meaning: str
    measured: bool = False

    @property
    def sigma(self) -> "Definition":
        """The column of its σ."""
        return Definition(f"sigma_{self.name}", self.unit, f"σ of {self.name}")

    def columns(self) -> tuple["Definition", ...]:
        """Itself, and its σ where it is measured."""
        return (self, self.sigma) if self.measured else (self,)


class TableDefinition(NamedTuple):
    """One table; `key` columns say which row it is."""

    meaning: str
    key: tuple[Definition, ...]
    values: tuple[Definition, ...]

    @property
    def columns(self) -> tuple[Definition, ...]:
        """All of them, in order."""
        return tuple(one for definition in (*self.key, *self.values) for one in definition.columns())


def _measured(name: str, unit: str, meaning: str) -> Definition:
    return Definition(name, unit, meaning, measured=True)


def _phases(before: str, what: str) -> tuple[Definition, ...]:
    names = {"a": "opening", "b": "open", "c": "closing", "d": "closed"}
    phases = (_measured(f"{before}_{p}_s", "s", f"{what} phase {p} ({word})") for p, word in names.items())
    ratio = _measured(f"{before}_ratio", "1", f"(a + b) / (a + b + c + d) of the {what} phases")
    return (*phases, ratio)


_FIELD = (
    Definition(
        "n", "", "number of the field: nominal 20 ms steps after the capture's first, lost ones included"
    ),
    Definition("time_s", "s", "middle of the field's exposure, from the first field of the capture on"),
)
_PHASE = (
    Definition(
        "phase", "1", "where in the mean cycle, from 0 to 1, counted from the beginning of wall phase a"
    ),
)

_WALL = (
    _measured("area_mm2", "mm²", "area of the outer face that data support, between the outermost targets"),
    Definition("covered", "1", "share of the target grid that data support; the area is of this share alone"),
    _measured("volume_mm3", "mm³", "between the plane and the wall, from the first section to the last"),
    _measured("pulsation_vacuum_kpa", "kPa", "vacuum in the pulsation chamber, below atmosphere"),
    _measured("liner_vacuum_kpa", "kPa", "vacuum in the liner, below atmosphere"),
    _measured("mean_contact_kpa", "kPa", "mean of contact_kpa over the targets where it is determined"),
    _measured(
        "greatest_contact_kpa", "kPa", "the greatest contact_kpa where it is determined; noise raises it"
    ),
    Definition("greatest_contact_target", "", "id of the target where it is"),
    Definition("determined", "", "at how many targets the pressure is determined"),
    _measured(
        "free_residual_kpa", "kPa", "what is left of contact_kpa where the wall is free; ought to be 0"
    ),
    Definition(
        "free_misfit", "1", "mean square of these residuals by their σ: about 1 where inputs are right"
    ),
    Definition("misfit", "1", "weighted square of the points' departure from the surface by its expectation"),
)
_SECTION = (
    Definition("height_mm", "mm", "where the section is: x in the object's frame"),
    _measured("distance_mm", "mm", "from the plane to the wall; twice it parts opposite walls if symmetric"),
    _measured("area_mm2", "mm²", "between the outline and the plane"),
    _measured("length_mm", "mm", "along the outline, from the first column of targets to the last"),
    _measured("chord_mm", "mm", "between the outline's ends"),
    _measured("least_width_mm", "mm", "least width of the outline; only where the targets go round"),
    _measured("opposite_mm", "mm", "least distance of opposite walls; only where the targets go round"),
)
_TARGET = (
    Definition("target", "", "id of the target, the same through the capture"),
    Definition("row", "", "its row on the target grid, from 0"),
    Definition("column", "", "its column on the target grid, from 0"),
    *(_measured(f"{a}_mm", "mm", f"{a.upper()} of the smooth outer face, object's frame") for a in "xyz"),
    _measured(
        "kappa1_per_m", "1/m", "greater principal curvature of the middle surface (outer without material)"
    ),
    _measured("kappa2_per_m", "1/m", "lesser principal curvature of the same"),
    _measured(
        "strain1", "1", "greater principal strain λ − 1 of the middle surface (outer without material)"
    ),
    _measured("strain2", "1", "lesser principal strain of the same"),
    _measured("tension1_n_per_m", "N/m", "greater principal tension of the wall"),
    _measured("tension2_n_per_m", "N/m", "lesser principal tension of the wall"),
    _measured("contact_kpa", "kPa", "pressure of the liner on the teat, above the pressure in the liner"),
    _measured("overpressure_kpa", "kPa", "the same above atmosphere"),
    Definition("wall_kpa", "kPa", "what the wall itself presses inward by its tension and bending"),
    Definition("points_sigma_kpa", "kPa", "the part of contact_kpa's σ from the points; the rest is common"),
)
_SINCE = _measured("since_touch_kpa", "kPa", "contact_kpa above that of the same place at the first touch")
_REASON = Definition(
    "reason", "", "why there is no pressure there; empty where there is, or where none was asked for"
)
_STRETCH = "present length by length in the reference state, on the face that `face` names"
_FACE = Definition("face", "", "outer: where the targets sit; middle: the wall's middle surface")

TABLES: Mapping[str, TableDefinition] = {
    "summary": TableDefinition(
        "One row: the pulsation and what was found of it",
        (),
        (
            Definition("fields", "", "fields of the capture that have points"),
            Definition("analysed", "", "those of them that make a surface"),
            Definition("missing", "", "fields without points between the first and the last that has some"),
            Definition("cycles", "1", "how many cycles the capture, and its bursts, span together"),
            _measured("period_s", "s", "length of the cycle"),
            _measured("rate_per_min", "1/min", "cycles a minute"),
            Definition("stroke_mm", "mm", "movement of the target that moves most, from closed to open"),
            Definition("residual_mm", "mm", "root mean square departure of the movement from the mean cycle"),
            Definition("expected_mm", "mm", "what it would be by the points' σ alone"),
            Definition("period_spread_s", "s", "standard deviation of the cycles' lengths"),
            Definition("stroke_spread", "1", "standard deviation of the cycles' strokes, by the mean one"),
            *_phases("wall", "wall"),
            *_phases("iso", "ISO"),
            _measured("offset_s", "s", "camera's time less the vacuum's, as the wall's movement shows it"),
            Definition("touch_n", "", "field in which pressure begins; the first where it has some already"),
            Definition("touch_target", "", "target at which it begins"),
        ),
    ),
    "fields": TableDefinition(
        "A row for each analysed field",
        _FIELD,
        (
            Definition("cycle", "", "number of the cycle, from 0; empty where no pulsation was found"),
            Definition("phase", "1", "where in its cycle, from 0 to 1, from the beginning of wall phase a"),
            _measured(
                "movement_mm", "mm", "how far the target that moves most is from its mean place, to +z"
            ),
            *_WALL,
        ),
    ),
    "sections": TableDefinition("A row for each analysed field and height", _FIELD, _SECTION),
    "targets": TableDefinition(
        "A row for each analysed field and target", _FIELD, (*_TARGET, _SINCE, _REASON)
    ),
    "phases": TableDefinition("The mean cycle: a row for each phase", _PHASE, _WALL),
    "phase_sections": TableDefinition("The mean cycle: a row for each phase and height", _PHASE, _SECTION),
    "phase_targets": TableDefinition(
        "The mean cycle: a row for each phase and target", _PHASE, (*_TARGET, _REASON)
    ),
    "cycles": TableDefinition(
        "A row for each whole cycle",
        (),
        (
            _measured("start_s", "s", "when wall phase a began"),
            _measured("stroke", "1", "its movement by that of the mean cycle"),
        ),
    ),
    "gaps": TableDefinition(
        "A row for each gap: fields without points between two that have some; none is filled",
        (),
        (
            Definition("after_n", "", "the last field before it"),
            Definition("until_n", "", "the first one after it"),
            Definition("missing", "", "how many fields are missing"),
        ),
    ),
    "triangles": TableDefinition(
        "A row for each field and triangle of neighbouring targets, seen in it and in the reference state",
        _FIELD,
        (
            *(Definition(f"target{k}", "", f"id of its corner {k}") for k in (1, 2, 3)),
            _measured("stretch1", "1", f"greater principal stretch: {_STRETCH}"),
            _measured("stretch2", "1", "lesser principal stretch of the same"),
            _FACE,
        ),
    ),
    "edges": TableDefinition(
        "A row for each field and pair of neighbouring targets, seen in it and in the reference state",
        _FIELD,
        (
            Definition("target1", "", "id of its first target"),
            Definition("target2", "", "id of its second target"),
            _measured("stretch", "1", _STRETCH),
            _FACE,
        ),
    ),
}
