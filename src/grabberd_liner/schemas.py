"""Forms of the files of liners that people write: inputs of an analysis, which `chain.analysis` reads key by
key, and profiles.
"""

from dataclasses import MISSING, fields

from pydantic import TypeAdapter

from grabberd.core.channels.vacuum import LEAST_KPA, MOST_KPA
from grabberd.schemas.files import (
    Form,
    Schema,
    either,
    integer,
    mapping,
    number,
    numbers,
    one_of,
    or_nothing,
    positive,
    text,
)
from grabberd_liner.analysis.load.pressure import UNSEEN
from grabberd_liner.analysis.other_method import ABOVE
from grabberd_liner.analysis.wall.material import LAWS, Material
from grabberd_liner.chain.analysis.agreement import ESTIMATED, GREATEST
from grabberd_liner.chain.analysis.inputs import FLOWING, MOST_PHASES, SOUGHT_KPA
from grabberd_liner.profiles.documents import ProfileContent

_ABOVE_0 = ("E_mpa", "wall_mm", "radius_mm")
_SIGNED = ("first_end_mm", "last_end_mm")


def analysis_inputs_schema() -> Schema:
    """The schema of the inputs of an analysis."""
    flow_stop = mapping({"kpa": positive(), "sigma_kpa": positive()}, ("kpa", "sigma_kpa"))
    heights = {"type": "array", "items": {"type": "number"}, "minItems": 1}
    return mapping(
        {
            "reference": or_nothing(_reference(), "State of the liner that strain counts from."),
            "material": material_schema(),
            "vacuum": or_nothing(_vacuum(), "Vacuum on both sides of the wall, kPa below atmosphere."),
            "teat": one_of("none", description="A ramp with the empty liner, for its own values."),
            "plane": or_nothing(_plane(), "Origin of widths, areas and volume."),
            "heights_mm": or_nothing(heights, "Heights of the sections: x in the object's frame."),
            "phases": integer("States of the mean cycle.", least=2, most=MOST_PHASES),
            "sought_kpa": positive(
                f"Smallest pressure that the map has to resolve; default: {SOUGHT_KPA:g}."
            ),
            "unseen": one_of(*UNSEEN, description="What stands for the half that no camera sees."),
            "flow_stop": or_nothing(flow_stop, "Pressure on the teat's end at which milk stops flowing."),
            "milk_flow": one_of(*FLOWING, description="What the channel flow reads while milk flows."),
            "agreement": or_nothing(_agreement(), "Pressures by another method, beside the map."),
            "average": integer("Fields of a still wall that become one, their mean.", least=1),
        }
    )


def _agreement() -> Schema:
    state = (mapping({"field": integer(least=0)}, ("field",)), mapping({"phase": number()}, ("phase",)))
    along, around = (
        mapping({value: number(), sigma: number()}, (value, sigma))
        for value, sigma in (("x_mm", "sigma_mm"), ("deg", "sigma_deg"))
    )
    return mapping(
        {
            "table": text("The text of the table."),
            "state": either(one_of(GREATEST), *state, description="State of the wall that it shows."),
            "above": one_of(*ABOVE, description="What its pressures are counted from."),
            "along": either(one_of(ESTIMATED), along, description="Where its origin lies along x."),
            "round": either(one_of(ESTIMATED), around, description="Angle of its origin."),
        },
        ("state",),
    )


def material_schema() -> Schema:
    """The schema of the wall's material: one for the whole liner, or one for each zone of rows."""
    rows = {"type": "array", "items": {"type": "integer", "minimum": 0}, "minItems": 2, "maxItems": 2}
    keys, needed = _material()
    zone = mapping({"rows": rows, **keys}, ("rows", *needed))
    zones = mapping({"zones": {"type": "array", "items": zone, "minItems": 1}}, ("zones",))
    return either(mapping(keys, needed), zones, description="The liner's wall as mounted.")


def _material() -> tuple[dict[str, Schema], tuple[str, ...]]:
    keys: dict[str, Schema] = {}
    for one in fields(Material):
        if one.name == "law":
            keys[one.name] = one_of(*LAWS)
        elif "correlation" in one.name:
            keys[one.name] = number(minimum=-1, maximum=1)
        elif one.name == "poisson":
            keys[one.name] = number(minimum=0, maximum=0.5)
        elif one.name in _ABOVE_0:
            keys[one.name] = positive()
        else:
            keys[one.name] = number() if one.name in _SIGNED else number(minimum=0)
    return keys, tuple(one.name for one in fields(Material) if one.default is MISSING)


def _reference() -> Schema:
    phase = number(minimum=0, exclusiveMaximum=1)
    return either(
        one_of("nominal"),
        mapping({"field": integer(least=0)}, ("field",)),
        mapping({"phase": phase}, ("phase",)),
        mapping({"capture": text()}, ("capture",)),
    )


def _plane() -> Schema:
    keys = {"point_mm": numbers(3), "normal": numbers(3)}
    return either(one_of("symmetry"), mapping(keys, ("point_mm", "normal")))


def _vacuum() -> Schema:
    kpa = {"kpa": number(minimum=0, maximum=MOST_KPA), "sigma_kpa": number(minimum=0)}
    constant = mapping(kpa, tuple(kpa), "A vacuum that does not change.")
    named = mapping({"channel": text("Name of one of the capture's channels.")}, ("channel",))
    offset = mapping({"s": number(), "sigma_s": number()}, ("s", "sigma_s"))
    lag = {key: number() for key in ("opening_s", "closing_s", "sigma_s", "near_s")}
    return mapping(
        {
            "pulsation": either(one_of("log", "channel"), named, constant, pulsation_schema()),
            "liner": either(one_of("log", "channel"), named, constant),
            "log": text("The text of a logger's file."),
            "offset": either(one_of("light"), offset, description="The camera's time less the logger's."),
            "lag": mapping(lag, tuple(lag), "The wall's lag, in place of offset."),
            "gauge_sigma_kpa": positive("σ of a gauge's zero."),
        }
    )


def pulsation_schema() -> Schema:
    """The schema of a pulsator's settings."""
    needed = {
        "rate_per_min": number(minimum=20, maximum=180),
        "ratio": number("(a + b) / (a + b + c + d).", exclusiveMinimum=0.1, exclusiveMaximum=0.9),
        "a_s": positive("Length of ISO's phase a."),
        "c_s": positive("Length of ISO's phase c."),
        "system_kpa": number(minimum=LEAST_KPA, maximum=MOST_KPA),
        "sigma_kpa": number(),
    }
    start = {"start_s": number("When its phase a begins."), "start_sigma_s": number()}
    return mapping({**needed, **start}, tuple(needed), "A pulsator by its settings.")


def profile_schema() -> Schema:
    """The schema of a profile of any kind; a liner's material is that of the inputs of an analysis."""
    schema = TypeAdapter(ProfileContent).json_schema()
    material = schema["$defs"]["LinerProfile"]["properties"]["material"]
    kept = {key: material[key] for key in ("default", "description") if key in material}
    schema["$defs"]["LinerProfile"]["properties"]["material"] = or_nothing(material_schema()) | kept
    return schema


ANALYSIS_INPUTS = Form("Inputs of an analysis besides the points (YAML).", analysis_inputs_schema)
PROFILE = Form("A profile of a liner, pulsator, cup or cow (YAML).", profile_schema)
