"""Documents of an analysis made by hand: a small wall in two states, three fields, two phases."""

import copy

TARGETS = [(k, k // 3, k % 3) for k in range(12)]
TRIANGLES = [
    corners
    for row in range(3)
    for column in range(2)
    for first in [3 * row + column]
    for corners in ([first, first + 3, first + 1], [first + 1, first + 3, first + 4])
]


def table(meaning, **columns):
    """A table; `name: (unit, values)`, and `name: (unit, values, sigmas)` where it is measured."""
    listed = []
    for name, (unit, values, *sigma) in columns.items():
        listed.append({"name": name, "unit": unit, "meaning": f"meaning of {name}", "values": values})
        if sigma:
            own = {"name": f"sigma_{name}", "unit": unit, "meaning": f"σ of {name}", "values": sigma[0]}
            listed.append(own)
    return {"meaning": meaning, "columns": listed}


def state(name, height_mm, reasons=("",) * 12):
    count = len(TARGETS)
    contact = [None if reason else 5.0 + k for k, reason in enumerate(reasons)]
    sigma = [None if reason else 2.0 for reason in reasons]
    return {
        "name": name,
        "targets": table(
            "targets",
            target=("", [t for t, _, _ in TARGETS]),
            row=("", [r for _, r, _ in TARGETS]),
            column=("", [c for _, _, c in TARGETS]),
            x_mm=("mm", [6.5 * r for _, r, _ in TARGETS], [0.01] * count),
            y_mm=("mm", [6.5 * c for _, _, c in TARGETS], [0.01] * count),
            z_mm=("mm", [height_mm - c for _, _, c in TARGETS], [0.02] * count),
            kappa1_per_m=("1/m", [80.0 + k for k in range(count)], [1.0] * count),
            strain1=("1", [0.01 * k for k in range(count)], [0.001] * count),
            tension1_n_per_m=("N/m", [100.0 + k for k in range(count)], [3.0] * count),
            contact_kpa=("kPa", contact, sigma),
            above_atmosphere_kpa=("kPa", [c and c - 42 for c in contact], sigma),
            reason=("", list(reasons)),
        ),
    }


def wall_columns(count):
    return {
        "area_mm2": ("mm²", [3000.0 + k for k in range(count)], [4.0] * count),
        "pulsation_vacuum_kpa": ("kPa", [20.0] * count, [0.5] * count),
        "liner_vacuum_kpa": ("kPa", [42.0] * count, [0.5] * count),
        "mean_contact_kpa": ("kPa", [8.0 + k for k in range(count)], [2.0] * count),
        "greatest_contact_kpa": ("kPa", [12.0] * count, [3.0] * count),
        "load_misfit": ("1", [0.62] * count),
        "misfit": ("1", [1.02] * count),
    }


def sections(key, places):
    heights = [-30.0, 30.0]
    return table(
        "sections",
        **{key: ("s", [place for place in places for _ in heights])},
        height_mm=("mm", heights * len(places)),
        distance_mm=("mm", [9.0 + k for k in range(2 * len(places))], [0.02] * 2 * len(places)),
    )


def full():
    """A document with everything."""
    closed = state(
        "closed (d)", 9.0, ("no targets near enough",) * 2 + ("σ of 3 kPa exceeds it (2 kPa)",) + ("",) * 9
    )
    return copy.deepcopy(
        {
            "schema": "grabberd/analysis-report/1",
            "id": "milking-<7>",
            "created_utc": "2026-11-21T15:00:00.000Z",
            "version": "0.1",
            "pressure_method": "equilibrium",
            "about": {"run": 1, "device": "barn", "note": "cow & teat"},
            "inputs": {
                "given": {"reference": "nominal", "material": {"E_mpa": 3}, "heights_mm": [-30, 30]},
                "reference": "the object model's nominal shape",
                "heights_mm": [-30, 30],
                "phases": 2,
                "lacks": ["plane: without it no widths"],
                "sources": {"material": "liner.yaml"},
            },
            "problems": ["left out: targets 63"],
            "grid": {"target": [t for t, _, _ in TARGETS], "triangles": TRIANGLES},
            "wall_phases": [
                {"phase": "a", "name": "opening", "first": 0.0, "end": 0.4},
                {"phase": "d", "name": "closed", "first": 0.4, "end": 1.0},
            ],
            "tables": {
                "summary": table(
                    "summary",
                    fields=("", [4]),
                    analysed=("", [3]),
                    missing=("", [1]),
                    cycles=("1", [2.5]),
                    period_s=("s", [1.0012], [0.0003]),
                    rate_per_min=("1/min", [59.93], [0.02]),
                    wall_a_s=("s", [0.101], [0.002]),
                    wall_ratio=("1", [0.6012], [0.0005]),
                    touch_n=("", [7]),
                    touch_target=("", [5]),
                ),
                "fields": table(
                    "fields",
                    n=("", [0, 1, 7]),
                    time_s=("s", [0.0, 0.02, 0.14]),
                    phase=("1", [0.1, 0.3, None]),
                    movement_mm=("mm", [0.1, 0.2, 0.3], [0.01] * 3),
                    **wall_columns(3),
                ),
                "sections": sections("time_s", [0.0, 0.02, 0.14]),
                "phases": table("phases", phase=("1", [0.0, 0.5]), **wall_columns(2)),
                "phase_sections": sections("phase", [0.0, 0.5]),
                "phase_profile": table(
                    "load over height",
                    phase=("1", [0.0] * 3 + [0.5] * 3),
                    x_mm=("mm", [-5.0, 0.0, 5.0] * 2),
                    compression_kpa=("kPa", [1.0, 2.0, 1.0, 20.0, 30.0, 20.0], [1.0] * 6),
                    load_n_per_mm=("N/mm", [0.1, 0.2, 0.1, 0.8, 1.0, 0.8], [0.05] * 6),
                    gap_mm=("mm", [20.0] * 3 + [14.0, 12.0, 0.1], [0.1] * 6),
                ),
                "quantities": table(
                    "quantities",
                    name=("", ["teat_load_n", "teat_end_beyond_flow_stop_kpa", "phase_b_share"]),
                    title=("", ["teat load", "beyond flow stop", "phase b of the cycle"]),
                    value=("", [38.7312, None, 0.4512], [1.5, None, 0.002]),
                    unit=("", ["N", "kPa", "1"]),
                    verdict=("", ["", "", "met"]),
                    reason=("", ["", "flow_stop was not given", ""]),
                    definition=("", ["Force of one side.", "Pressure that is left.", "Share of phase b."]),
                    source=("", ["the wall", "the literature", "ISO 5707"]),
                ),
                "cycles": table("cycles", start_s=("s", [0.1], [0.01]), stroke=("1", [1.0], [0.01])),
                "gaps": table("gaps", after_n=("", [1]), until_n=("", [7]), missing=("", [5])),
            },
            "states": [state("opening (a)", 12.0), closed],
        }
    )


def earlier():
    """A document whose pressures were found by differentiating the shape, with the columns of that time."""
    document = full()
    del document["pressure_method"]
    for state in document["states"]:
        columns = {one["name"]: one for one in state["targets"]["columns"]}
        for name in ("above_atmosphere_kpa", "sigma_above_atmosphere_kpa"):
            columns[name]["name"] = name.replace("above_atmosphere", "overpressure")
        contact, sigma = columns["contact_kpa"]["values"], columns["sigma_contact_kpa"]["values"]
        state["targets"]["columns"] += table(
            "",
            wall_kpa=("kPa", contact),
            points_sigma_kpa=("kPa", [s and 1.2 for s in sigma]),
            since_touch_kpa=("kPa", contact, sigma),
        )["columns"]
    for name, count in (("fields", 3), ("phases", 2)):
        columns = [one for one in document["tables"][name]["columns"] if one["name"] != "load_misfit"]
        residual = {
            "free_residual_kpa": ("kPa", [0.3] * count, [0.5] * count),
            "free_misfit": ("1", [1.1] * count),
        }
        document["tables"][name]["columns"] = columns + table("", **residual)["columns"]
    return document


def least():
    """A document of which only the shape of one field is known."""
    document = full()
    document["inputs"] |= {"given": {}, "reference": None, "lacks": ["material: without it no pressure"]}
    document["wall_phases"], document["problems"] = None, ["there is no pulsation"]
    empty = {
        name: table(name)
        for name in ("sections", "phases", "phase_sections", "phase_profile", "quantities", "cycles", "gaps")
    }
    document["tables"] |= empty | {
        "summary": table("summary", fields=("", [1]), analysed=("", [1]), missing=("", [0])),
        "fields": table("fields", n=("", [0]), time_s=("s", [0.0]), area_mm2=("mm²", [3000.0], [4.0])),
    }
    known = {
        "target",
        "row",
        "column",
        "x_mm",
        "y_mm",
        "z_mm",
        "kappa1_per_m",
        "sigma_kappa1_per_m",
        "reason",
    }
    columns = document["states"][0]["targets"]["columns"]
    targets = {"meaning": "targets", "columns": [one for one in columns if one["name"] in known]}
    document["states"] = [{"name": "field 0", "targets": targets}]
    return document
