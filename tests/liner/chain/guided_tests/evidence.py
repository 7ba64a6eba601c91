"""Evidence of guided tests: captures of walls solved as solids, and tables with chosen quantities."""

import numpy as np

from grabberd.core.chain.columns import make_table
from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.pulsation.movement import TimedPoints
from grabberd_liner.chain.analysis.analyse import analyse
from grabberd_liner.chain.analysis.columns import TABLES
from grabberd_liner.chain.analysis.inputs import read_inputs
from grabberd_liner.chain.analysis.profile_inputs import Profile
from grabberd_liner.chain.analysis.tables import tables
from grabberd_liner.chain.analysis.wall_state import FieldPoints, averaged_fields
from grabberd_liner.chain.guided_tests.outcome import Evidence

FIELD_S = 0.02
UNITS = {"touch_kpa": "kPa", "stiffness_n_mm": "N mm", "liner_closing_s": "s"}


def material_of(liner, **changed):
    """Material of a solved liner, as a profile has it."""
    design = liner.design
    return {
        "law": "neo_hookean",
        "E_mpa": design["young_mpa"],
        "E_sigma_mpa": 0.1 * design["young_mpa"],
        "wall_mm": design["wall_mm"],
        "wall_sigma_mm": 0.02 * design["wall_mm"],
        "F0_n": design["pretension_n"],
        "F0_sigma_n": 0.1 * design["pretension_n"],
        "poisson": 0.5,
        "radius_mm": design["radius_mm"],
        "target_mm": 0.0,
        "first_end_mm": -65.0,
        "last_end_mm": 65.0,
    } | changed


def profile(**content):
    return Profile("liner", "A", 3, "0" * 64, {"kind": "liner", "name": "A"} | content)


def still_fields(liner, kpa=0.0, count=24, seed=0):
    """Fields of a wall at rest."""
    return [
        FieldPoints(n, TimedPoints(n * FIELD_S, liner.points(kpa, 1000 * seed + n))) for n in range(count)
    ]


def analysed(fields, grid, inputs, **known):
    """A capture with its analysis."""
    read = read_inputs(inputs, grid)
    found = analyse(
        [averaged_fields(fields, read.average)], grid, read, reference=known.pop("reference", None)
    )
    return evidence(captured=fields, analysis=found, tables=tables(found), **known)


def evidence(**changed):
    """A capture that nothing is wrong with, but for what is changed."""
    usual = {
        "id": "20260301T093000Z-barn",
        "captured_utc": "2026-03-01T09:30:00.000Z",
        "labels": {"liner": "A"},
        "ledger": {"total": 100, "received": 100},
        "calibration": "rig",
        "acceptance": "passed",
        "liner": profile(material={}),
        "captured": (),
        "analysis": None,
        "tables": {},
    }
    return Evidence(**{**usual, **changed})


def with_quantities(found, **known):
    """A capture whose analysis found these quantities: (value, σ, common part of it)."""
    values, sigmas, common = (np.array([one[part] for one in found.values()]) for part in range(3))
    texts = {name: np.array([name] * len(found)) for name in ("definition", "source")}
    nothing = np.array([""] * len(found))
    rows = {
        "name": np.array(list(found)),
        "title": np.array([name.rpartition("_")[0] for name in found]),
        "value": Estimate(values, sigmas),
        "sigma_common": common,
        "unit": np.array([UNITS[name] for name in found]),
        "verdict": nothing,
        "reason": nothing,
        **texts,
    }
    return evidence(tables={"quantities": make_table("quantities", TABLES["quantities"], rows)}, **known)


def by_name(outcome):
    """Checks by their names."""
    return {one.name: one for one in outcome.checks}
