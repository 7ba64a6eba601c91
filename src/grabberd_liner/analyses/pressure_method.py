"""The way in which an analysis found its pressures, and what is said of those of earlier analyses."""

PRESSURE_METHOD = "equilibrium"
"""Pressure as the load of a wall in equilibrium (docs/decisions/0021). Earlier analyses name no method."""

OUTDATED_TITLE = "Wrong pressures"
OUTDATED_PRESSURE = (
    "The pressures of this analysis are wrong: they were computed by differentiating the wall's shape, which "
    "errs by tens of kPa where the wall folds. Mean and greatest pressure and the first touch follow from "
    "them. Curvature, strain and tension of its closed wall err in the outermost columns that are seen, "
    "strain by 15 %. Points, sections, areas and pulsation are right.",
    "Analyse the capture again, and give the ends between which the liner is held, material.first_end_mm and "
    "material.last_end_mm: grabberd analyse CAPTURE.grab --inputs INPUTS.yaml --out FOLDER, or “New "
    "analysis” on the page.",
    "Files exported from this analysis have the same wrong pressures; their tables are known by the columns "
    "overpressure_kpa and free_residual_kpa.",
)
"""What a report says of outdated pressures, and what to do about them."""


def is_outdated(method: str | None, has_pressures: bool) -> bool:
    """True if an analysis has pressures of the earlier, wrong way."""
    return has_pressures and method is None
