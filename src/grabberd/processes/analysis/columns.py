"""The tables of an analysis and their columns: name, unit, type and meaning."""

from collections.abc import Mapping

from grabberd.processes.columns import Column, TableSpec


def _measured(name: str, unit: str, meaning: str) -> Column:
    return Column(name, unit, "f8", meaning, measured=True)


def _number(name: str, unit: str, meaning: str) -> Column:
    return Column(name, unit, "f8", meaning)


def _count(name: str, meaning: str) -> Column:
    return Column(name, "", "i8", meaning)


def _id(name: str, meaning: str) -> Column:
    return Column(name, "", "i4", meaning)


def _text(name: str, meaning: str) -> Column:
    return Column(name, "", "U", meaning)


def _phases(before: str, what: str) -> tuple[Column, ...]:
    names = {"a": "opening", "b": "open", "c": "closing", "d": "closed"}
    phases = (_measured(f"{before}_{p}_s", "s", f"{what} phase {p} ({word})") for p, word in names.items())
    ratio = _measured(f"{before}_ratio", "1", f"(a + b) / (a + b + c + d) of the {what} phases")
    return (*phases, ratio)


_FIELD = (
    _count("n", "number of the field: nominal steps after the capture's first, lost ones included"),
    _number("time_s", "s", "middle of the field's exposure, from the first field of the capture on"),
)
_PHASE = (
    _number("phase", "1", "where in the mean cycle, from 0 to 1, counted from the beginning of wall phase a"),
)

_WALL = (
    _measured("area_mm2", "mm²", "area of the outer face that data support, between the outermost targets"),
    _number("covered", "1", "share of the target grid that data support; the area is of this share alone"),
    _measured("volume_mm3", "mm³", "between the plane and the wall, from the first section to the last"),
    _measured("pulsation_vacuum_kpa", "kPa", "vacuum in the pulsation chamber, below atmosphere"),
    _measured("liner_vacuum_kpa", "kPa", "vacuum in the liner, below atmosphere"),
    _measured("mean_contact_kpa", "kPa", "mean of contact_kpa over the targets where it is determined"),
    _measured(
        "greatest_contact_kpa", "kPa", "the greatest contact_kpa where it is determined; noise raises it"
    ),
    _id("greatest_contact_target", "id of the target where it is"),
    _count("determined", "at how many targets the pressure is determined"),
    _number("load_misfit", "1", "misfit of points and wall in equilibrium; .3 to 1.2 is usual, 2 refused"),
    _text(
        "method",
        "where shape, strain and tension are from: equilibrium, the wall that explains the targets, or "
        "smooth, a surface through them, which knows little of a closed wall between and beside its columns",
    ),
    _number("misfit", "1", "weighted square of the points' departure from the outer face by its expectation"),
)
_SECTION = (
    _number("height_mm", "mm", "where the section is: x in the object's frame"),
    _measured("distance_mm", "mm", "from the plane to the wall; twice it parts opposite walls if symmetric"),
    _measured("area_mm2", "mm²", "between the outline and the plane"),
    _measured("length_mm", "mm", "along the outline, from the first column of targets to the last"),
    _measured("chord_mm", "mm", "between the outline's ends"),
    _measured("least_width_mm", "mm", "least width of the outline; only where the targets go round"),
    _measured("opposite_mm", "mm", "least distance of opposite walls; only where the targets go round"),
)
_TARGET = (
    _id("target", "id of the target, the same through the capture"),
    _id("row", "its row on the target grid, from 0"),
    _id("column", "its column on the target grid, from 0"),
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
    _measured(
        "above_atmosphere_kpa", "kPa", "the same above atmosphere, that is less the vacuum in the liner"
    ),
    _number("unseen_kpa", "kPa", "contact_kpa less what it would be with a free hidden half, if mirrored"),
)
_PROFILE = (
    _number("x_mm", "mm", "height on the mounted tube: x in the object's frame; it stays with the material"),
    _measured(
        "compression_kpa", "kPa", "mean contact pressure over the arc between the outermost columns seen"
    ),
    _measured("load_n_per_mm", "N/mm", "force on one side of the teat per present length of the tube"),
    _measured("gap_mm", "mm", "between the inner faces of opposite walls; takes the hidden half as mirrored"),
)
_REASON = _text("reason", "why there is no pressure there; empty where there is, or where none was asked for")
_STRETCH = "present length by length in the reference state, on the outer face, where the targets sit"

TABLES: Mapping[str, TableSpec] = {
    "summary": TableSpec(
        "One row: the pulsation and what was found of it",
        (),
        (
            _count("fields", "fields of the capture that have points"),
            _count("analysed", "those of them that make a surface"),
            _count("missing", "fields without points between the first and the last that has some"),
            _number("cycles", "1", "how many cycles the capture, and its bursts, span together"),
            _measured("period_s", "s", "length of the cycle"),
            _measured("rate_per_min", "1/min", "cycles a minute"),
            _measured("stroke_mm", "mm", "movement of the target that moves most, from closed to open"),
            _number("residual_mm", "mm", "root mean square departure of the movement from the mean cycle"),
            _number("expected_mm", "mm", "what it would be by the points' σ alone"),
            _number("period_spread_s", "s", "standard deviation of the cycles' lengths"),
            _number("stroke_spread", "1", "standard deviation of the cycles' strokes, by the mean one"),
            *_phases("wall", "wall"),
            *_phases("iso", "ISO"),
            _measured(
                "offset_s", "s", "camera's time less the vacuum's, by the light or the wall's movement"
            ),
            _measured("clock_drift", "1", "seconds that the vacuum's clock loses in one, by the light"),
            _count("light_switchings", "switchings of the light that relate the clocks"),
            _measured(
                "opening_lag_s",
                "s",
                "from the vacuum's half height to the wall's half stroke, by the light or on one clock",
            ),
            _measured("closing_lag_s", "s", "likewise, closing"),
            _number("clock_kpa", "kPa", "σ of the vacuum on its steepest slope for want of a common clock"),
            _count("touch_n", "field in which pressure begins; the first where it has some already"),
            _id("touch_target", "target at which it begins"),
        ),
    ),
    "ramp": TableSpec(
        "A ramp with the empty liner: one row with the liner's own values; without a ramp, none",
        (),
        (
            _measured("E_mpa", "MPa", "Young's modulus of the mounted liner"),
            _measured("wall_mm", "mm", "thickness of its wall"),
            _measured("F0_n", "N", "its pretension"),
            _measured(
                "stiffness_n_mm", "N mm", "bending stiffness E t³ / 12 (1 − ν²): better known than its parts"
            ),
            _number(
                "load_misfit",
                "1",
                "misfit of points and the empty wall in equilibrium; 1 is usual, 2 refused",
            ),
            _count("levels", "fields that were fitted"),
            _measured("touch_kpa", "kPa", "TPPD: pressure difference at which opposite walls touch"),
            _measured("buckling_kpa", "kPa", "CCPD: pressure difference at which the liner buckles"),
            _text(
                "material", "the material with the liner's own values, as JSON: input of the other analyses"
            ),
        ),
    ),
    "fields": TableSpec(
        "A row for each analysed field",
        _FIELD,
        (
            _number("cycle", "", "number of the cycle, from 0; empty where no pulsation was found"),
            _number("phase", "1", "where in its cycle, from 0 to 1, from the beginning of wall phase a"),
            _measured(
                "movement_mm", "mm", "how far the target that moves most is from its mean place, to +z"
            ),
            *_WALL,
        ),
    ),
    "sections": TableSpec("A row for each analysed field and height", _FIELD, _SECTION),
    "profile": TableSpec("The load over height: a row for each field and height", _FIELD, _PROFILE),
    "targets": TableSpec("A row for each analysed field and target", _FIELD, (*_TARGET, _REASON)),
    "phases": TableSpec("The mean cycle: a row for each phase", _PHASE, _WALL),
    "phase_sections": TableSpec("The mean cycle: a row for each phase and height", _PHASE, _SECTION),
    "phase_targets": TableSpec(
        "The mean cycle: a row for each phase and target", _PHASE, (*_TARGET, _REASON)
    ),
    "phase_profile": TableSpec(
        "The mean cycle: the load over height, a row for each phase and height", _PHASE, _PROFILE
    ),
    "quantities": TableSpec(
        "The field's own quantities, a row for each; the definitions are in the rows",
        (_text("name", "name of the quantity; it ends with its unit where it has one"),),
        (
            _text("title", "what it is called"),
            _measured("value", "", "its value, in the row's unit; empty where there is a reason"),
            _number(
                "sigma_common",
                "",
                "part of σ that captures share which are analysed with the same liner values and gauges: "
                "averaging them does not lessen it",
            ),
            _text("unit", "its unit; 1 for a ratio"),
            _text("verdict", "met, not met or not certain, where a standard sets a limit; else empty"),
            _text("reason", "why it has no value; empty if it has one"),
            _text("definition", "what it is, in a sentence"),
            _text("source", "where the term is from"),
        ),
    ),
    "cycles": TableSpec(
        "A row for each whole cycle",
        (),
        (
            _measured("start_s", "s", "when wall phase a began"),
            _measured("stroke", "1", "its movement by that of the mean cycle"),
        ),
    ),
    "gaps": TableSpec(
        "A row for each gap: fields without points between two that have some; none is filled",
        (),
        (
            _count("after_n", "the last field before it"),
            _count("until_n", "the first one after it"),
            _count("missing", "how many fields are missing"),
        ),
    ),
    "triangles": TableSpec(
        "A row for each field and triangle of neighbouring targets, seen in it and in the reference state",
        _FIELD,
        (
            *(_id(f"target{k}", f"id of its corner {k}") for k in (1, 2, 3)),
            _measured("stretch1", "1", f"greater principal stretch: {_STRETCH}"),
            _measured("stretch2", "1", "lesser principal stretch of the same"),
        ),
    ),
    "edges": TableSpec(
        "A row for each field and pair of neighbouring targets, seen in it and in the reference state",
        _FIELD,
        (
            _id("target1", "id of its first target"),
            _id("target2", "id of its second target"),
            _measured("stretch", "1", _STRETCH),
        ),
    ),
}
