"""The tables of an analysis and their columns: name, unit, type and meaning."""

from collections.abc import Mapping

from grabberd.core.chain.columns import Column, TableSpec


def measured(name: str, unit: str, meaning: str) -> Column:
    """A number with σ."""
    return Column(name, unit, "f8", meaning, measured=True)


def number(name: str, unit: str, meaning: str) -> Column:
    """A number without σ."""
    return Column(name, unit, "f8", meaning)


def _count(name: str, meaning: str) -> Column:
    return Column(name, "", "i8", meaning)


def _id(name: str, meaning: str) -> Column:
    return Column(name, "", "i4", meaning)


def text(name: str, meaning: str) -> Column:
    """A column of text."""
    return Column(name, "", "U", meaning)


def _phases(before: str, what: str) -> tuple[Column, ...]:
    names = {"a": "opening", "b": "open", "c": "closing", "d": "closed"}
    phases = (measured(f"{before}_{p}_s", "s", f"{what} phase {p} ({word})") for p, word in names.items())
    ratio = measured(f"{before}_ratio", "1", f"(a + b) / (a + b + c + d) of the {what} phases")
    return (*phases, ratio)


_FIELD = (
    _count("n", "number of the field: nominal steps since the capture's first, including lost ones"),
    number("time_s", "s", "middle of the field's exposure, since the capture's first field"),
)
_PHASE = (
    number("phase", "1", "position in the mean cycle, from 0 to 1, counted from the start of wall phase a"),
)

_WALL = (
    measured(
        "area_mm2", "mm²", "area of the outer face between the outermost targets, where supported by data"
    ),
    number("covered", "1", "share of the target grid supported by data, to which the area refers"),
    measured("volume_mm3", "mm³", "between the plane and the wall, from the first section to the last"),
    measured("pulsation_vacuum_kpa", "kPa", "vacuum in the pulsation chamber, below atmosphere"),
    measured("liner_vacuum_kpa", "kPa", "vacuum in the liner, below atmosphere"),
    measured("mean_contact_kpa", "kPa", "mean of contact_kpa over the targets where it is determined"),
    measured("mean_above_atmosphere_kpa", "kPa", "the same above atmosphere: minus the vacuum in the liner"),
    measured(
        "greatest_contact_kpa", "kPa", "the greatest contact_kpa where it is determined; noise raises it"
    ),
    _id("greatest_contact_target", "id of the target with the greatest value"),
    _count("determined", "number of targets where the pressure is determined"),
    number("load_misfit", "1", "misfit of points and wall in equilibrium; .3 to 1.2 is usual, 2 refused"),
    text(
        "method",
        "where shape, strain and tension are from: equilibrium, the wall that explains the targets, or "
        "smooth, a surface through them, which knows little of a closed wall between and beside its columns",
    ),
    number(
        "misfit", "1", "weighted squared deviation of the points from the outer face, over its expectation"
    ),
)
_SECTION = (
    number("height_mm", "mm", "height of the section: x in the object's frame"),
    measured(
        "distance_mm", "mm", "from the plane to the wall; half the distance of opposite walls if symmetric"
    ),
    measured("area_mm2", "mm²", "between the outline and the plane"),
    measured("length_mm", "mm", "along the outline, from the first column of targets to the last"),
    measured("chord_mm", "mm", "between the outline's ends"),
    measured("least_width_mm", "mm", "least width of the outline; only if the targets go all the way round"),
    measured(
        "opposite_mm", "mm", "least distance of opposite walls; only if the targets go all the way round"
    ),
)
_TARGET = (
    _id("target", "id of the target, the same through the capture"),
    _id("row", "its row on the target grid, from 0"),
    _id("column", "its column on the target grid, from 0"),
    *(measured(f"{a}_mm", "mm", f"{a.upper()} of the smooth outer face, object's frame") for a in "xyz"),
    measured(
        "kappa1_per_m",
        "1/m",
        "greater principal curvature of the middle surface (outer one without material)",
    ),
    measured("kappa2_per_m", "1/m", "lesser principal curvature of the same"),
    measured(
        "strain1", "1", "greater principal strain λ − 1 of the middle surface (outer one without material)"
    ),
    measured("strain2", "1", "lesser principal strain of the same"),
    measured("tension1_n_per_m", "N/m", "greater principal tension of the wall"),
    measured("tension2_n_per_m", "N/m", "lesser principal tension of the wall"),
    measured("contact_kpa", "kPa", "pressure of the liner on the teat, above the pressure in the liner"),
    measured("above_atmosphere_kpa", "kPa", "the same above atmosphere: minus the vacuum in the liner"),
    number(
        "unseen_kpa", "kPa", "change of contact_kpa by mirroring the hidden half instead of leaving it free"
    ),
)
_PROFILE = (
    number("x_mm", "mm", "height on the mounted tube: x in the object's frame; it stays with the material"),
    measured(
        "compression_kpa",
        "kPa",
        "mean contact pressure over the arc of the outermost columns seen, above the pressure in the liner",
    ),
    measured(
        "compression_above_atmosphere_kpa", "kPa", "the same above atmosphere: minus the vacuum in the liner"
    ),
    measured("load_n_per_mm", "N/mm", "force on one side of the teat per present length of the tube"),
    measured(
        "gap_mm", "mm", "between the inner faces of opposite walls, assuming a mirror-symmetric hidden half"
    ),
)
_REASON = text("reason", "why there is no pressure there; empty if there is, or if none was requested")
_STRETCH = "present length divided by that in the reference state, on the outer face, where the targets are"

TABLES: Mapping[str, TableSpec] = {
    "summary": TableSpec(
        "One row: the pulsation and what was found of it",
        (),
        (
            _count("fields", "fields of the capture that have points"),
            _count("analysed", "those for which a surface was computed"),
            _count("missing", "fields without points between the first and the last with points"),
            number("cycles", "1", "number of cycles that the capture and its bursts span"),
            measured("period_s", "s", "length of the cycle"),
            measured("rate_per_min", "1/min", "cycles a minute"),
            measured("stroke_mm", "mm", "movement of the target that moves most, from closed to open"),
            number("residual_mm", "mm", "root mean square deviation of the movement from the mean cycle"),
            number("expected_mm", "mm", "its expected value from the points' σ alone"),
            number("period_spread_s", "s", "standard deviation of the cycles' lengths"),
            number(
                "stroke_spread", "1", "standard deviation of the cycles' strokes, relative to the mean stroke"
            ),
            *_phases("wall", "wall"),
            *_phases("iso", "ISO"),
            measured(
                "offset_s", "s", "camera's time minus the vacuum's, from the light or the wall's movement"
            ),
            measured(
                "clock_drift", "1", "seconds per second by which the vacuum's clock is slow, from the light"
            ),
            _count("light_switchings", "switchings of the light that relate the clocks"),
            measured(
                "opening_lag_s",
                "s",
                "from half the vacuum to half the wall's stroke, with clocks related by the light or shared",
            ),
            measured("closing_lag_s", "s", "likewise, closing"),
            number(
                "clock_kpa", "kPa", "σ of the vacuum on its steepest slope due to the uncertain clock offset"
            ),
            _count("touch_n", "field in which contact begins; the first field if there is contact already"),
            _id("touch_target", "target at which contact begins"),
        ),
    ),
    "ramp": TableSpec(
        "A ramp with the empty liner: one row with the liner's own values; without a ramp, none",
        (),
        (
            measured("E_mpa", "MPa", "Young's modulus of the mounted liner"),
            measured("wall_mm", "mm", "thickness of its wall"),
            measured("F0_n", "N", "its pretension"),
            measured(
                "stiffness_n_mm", "N mm", "bending stiffness E t³ / 12 (1 − ν²): better known than its parts"
            ),
            number(
                "load_misfit",
                "1",
                "misfit of points and the empty wall in equilibrium; 1 is usual, 2 refused",
            ),
            _count("levels", "fields that were fitted"),
            measured("touch_kpa", "kPa", "TPPD: pressure difference at which opposite walls touch"),
            measured("buckling_kpa", "kPa", "CCPD: pressure difference at which the liner buckles"),
            text(
                "material", "the material with the liner's own values, as JSON: input of the other analyses"
            ),
        ),
    ),
    "fields": TableSpec(
        "A row for each analysed field",
        _FIELD,
        (
            number("cycle", "", "number of the cycle, from 0; empty where no pulsation was found"),
            number(
                "phase", "1", "position in its cycle, from 0 to 1, counted from the start of wall phase a"
            ),
            measured(
                "movement_mm",
                "mm",
                "distance of the target that moves most from its mean position, toward +z",
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
        "Quantities used in milking research, one per row, with their definitions",
        (text("name", "name of the quantity, ending with its unit if it has one"),),
        (
            text("title", "what it is called"),
            measured("value", "", "its value, in the row's unit; empty where there is a reason"),
            number(
                "sigma_common",
                "",
                "part of σ shared by captures that are analysed with the same liner values and gauges: "
                "not reduced by averaging them",
            ),
            text("unit", "its unit; 1 for a ratio"),
            text("verdict", "met, not met or not certain, if a standard sets a limit; else empty"),
            text("reason", "why it has no value; empty if it has one"),
            text("definition", "definition of the quantity, in a sentence"),
            text("source", "where the term is from"),
        ),
    ),
    "cycles": TableSpec(
        "A row for each whole cycle",
        (),
        (
            measured("start_s", "s", "when wall phase a began"),
            measured("stroke", "1", "its movement relative to that of the mean cycle"),
        ),
    ),
    "gaps": TableSpec(
        "A row for each gap of fields without points; none is filled",
        (),
        (
            _count("after_n", "the last field before it"),
            _count("until_n", "the first one after it"),
            _count("missing", "how many fields are missing"),
        ),
    ),
    "agreement": TableSpec(
        "Agreement of the map with another method, after Bland and Altman: one row, or none without one",
        (),
        (
            text("state", "phase or field whose map was compared"),
            text("above", "what pressures are counted from here: the gas in the liner, or atmosphere"),
            _count("places", "places of the other method in the supported part of the map"),
            _count("outside", "its places elsewhere, which were left out"),
            measured("origin_x_mm", "mm", "x of the table's origin in the object's frame"),
            measured("origin_round_deg", "deg", "angle of the table's origin round the teat's axis"),
            text("estimated", "which of the two were estimated, and not given"),
            measured("bias_kpa", "kPa", "mean difference: map less other method"),
            number("bias_low_kpa", "kPa", "lower end of its 95 % confidence interval"),
            number("bias_high_kpa", "kPa", "upper end of its 95 % confidence interval"),
            number("sd_kpa", "kPa", "standard deviation of the differences"),
            number("expected_sd_kpa", "kPa", "what the σ of both methods and of the origin let expect"),
            number("lower_kpa", "kPa", "lower 95 % limit of agreement: bias less 1.96 standard deviations"),
            number("lower_low_kpa", "kPa", "lower end of its 95 % confidence interval"),
            number("lower_high_kpa", "kPa", "upper end of its 95 % confidence interval"),
            number("upper_kpa", "kPa", "upper 95 % limit of agreement"),
            number("upper_low_kpa", "kPa", "lower end of its 95 % confidence interval"),
            number("upper_high_kpa", "kPa", "upper end of its 95 % confidence interval"),
            number(
                "independent",
                "1",
                "degrees of freedom of sd_kpa: fewer than places - 1, as errors go together",
            ),
            measured("slope", "1", "proportional bias: slope of the difference on the mean of both methods"),
            number("chi2", "1", "of the differences about their weighted mean; dof if both σ explain them"),
            _count("dof", "degrees of freedom of chi2"),
            number("p", "1", "probability of a larger chi2 if the σ of both methods explain the differences"),
            text("reason", "why there is no agreement; empty if there is one"),
        ),
    ),
    "agreement_places": TableSpec(
        "The places of the other method that were compared, a row each",
        (),
        (
            number("x_mm", "mm", "along the teat's axis: x in the object's frame"),
            number("round_deg", "deg", "round it, from the middle of the targets towards +y"),
            measured("map_kpa", "kPa", "the map, averaged over the other method's cell"),
            measured("other_kpa", "kPa", "the other method"),
            measured(
                "difference_kpa", "kPa", "map less other method; in its σ those of both and of the origin"
            ),
        ),
    ),
    "triangles": TableSpec(
        "A row for each field and triangle of neighbouring targets, seen in it and in the reference state",
        _FIELD,
        (
            *(_id(f"target{k}", f"id of its corner {k}") for k in (1, 2, 3)),
            measured("stretch1", "1", f"greater principal stretch: {_STRETCH}"),
            measured("stretch2", "1", "lesser principal stretch of the same"),
        ),
    ),
    "edges": TableSpec(
        "A row for each field and pair of neighbouring targets, seen in it and in the reference state",
        _FIELD,
        (
            _id("target1", "id of its first target"),
            _id("target2", "id of its second target"),
            measured("stretch", "1", _STRETCH),
        ),
    ),
}
