"""Output of `grabberd accuracy`: tables for people, a JSON document for scripts."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from grabberd.core.chain.accuracy import Compared, Investigation
    from grabberd.core.reconstruction.accuracy.accuracy import Axes
    from grabberd.core.reconstruction.accuracy.pointing import PointingPrecision
    from grabberd.core.reconstruction.accuracy.rigid_motion import RigidMotion

MUCH_CHI2 = 4.0
"""Above this the errors are more than twice the σ that the points carry."""


def show(results: "Sequence[Investigation]", console: Console) -> None:
    """Print Table 1, lengths and pointing of every investigation."""
    from grabberd.core.reconstruction.accuracy.accuracy import PAPER_PRECISION, PAPER_RMSE  # noqa: PLC0415

    table = Table("mm", "X", "Y", "Z", "XYZ", title="Accuracy, as in the paper's Table 1")
    _row(table, "paper, RMSE", PAPER_RMSE)
    _row(table, "paper, precision (σ)", PAPER_PRECISION)
    for result in results:
        table.add_section()
        for name, compared in (("single fields", result.single), ("smoothed", result.smoothed)):
            head = f"{_bits(result.bits)}, {name}"
            _row(table, f"{head}, RMSE", compared.accuracy.rmse)
            if compared.accuracy.precision and compared is result.single:
                _row(table, f"{head}, precision (σ)", compared.accuracy.precision)
            _row(table, f"{head}, predicted σ", compared.sigma)
    console.print(table)
    for result in results:
        for line in _words(result):
            console.print(line, highlight=False, soft_wrap=True)


def _row(table: Table, name: str, axes: "Axes") -> None:
    table.add_row(name, *(f"{value:.4f}" for value in axes))


def _bits(bits: int) -> str:
    return f"{bits} bit" if bits == 1 else f"{bits} bits"


def _words(result: "Investigation") -> list[str]:
    table, motion = result.single.accuracy, result.smoothing
    head = _bits(result.bits)
    left_out = int(motion.left_out.sum())
    words = [
        f"{head}: {table.matched} points in {table.fields} fields; {table.missing} missing, "
        f"{table.wrong} wrong, {table.unknown} of targets missing from the truth",
        f"{head}: χ² {result.single.chi2:.2f} for single fields, {result.smoothed.chi2:.2f} smoothed (1: the "
        f"predicted σ is right); {_movement(motion.acceleration_mm_s2)}; {left_out} points left out",
    ]
    words += [f"{head}: remark: {remark}" for remark in _remarks(result.single)]
    if table.fitted:
        words.append(f"{head}: fitted: {_fit_words(table.fitted)}")
    for name, compared in (("single fields", result.single), ("smoothed", result.smoothed)):
        words.append(f"{head}, {name}: {_length_words(compared)}")
    if result.pointing:
        words.append(f"{head}: {_pointing_words(result.pointing)}")
    return words


def _remarks(compared: "Compared") -> list[str]:
    """Remarks on the calibration."""
    if compared.chi2 <= MUCH_CHI2:
        return []
    return [
        f"the errors are {compared.chi2**0.5:.1f} times the predicted σ: camera or mirrors may have moved "
        "since the calibration, or truth and object are not aligned; run grabberd check"
    ]


def _pointing_words(pointing: "PointingPrecision") -> str:
    from grabberd.core.reconstruction.accuracy.pointing import PAPER_PX  # noqa: PLC0415

    (x, y), (paper_x, paper_y) = pointing.both_px, PAPER_PX
    return (
        f"pointing {x:.3f} px in x, {y:.3f} px in y, from {pointing.fields} measurements of "
        f"{pointing.targets} targets (paper: {paper_x:.3f}, {paper_y:.3f})"
    )


def _movement(acceleration_mm_s2: "NDArray[np.float64]") -> str:
    greatest = float(acceleration_mm_s2.max(initial=0.0))
    return "the object is at rest" if greatest == 0 else f"accelerations about {greatest:.0f} mm/s²"


def _fit_words(motion: "RigidMotion") -> str:
    shift = ", ".join(f"{value:+.4f}" for value in motion.shift_mm)
    return f"rotated by {motion.angle_deg:.4f} degrees, shifted by {shift} mm; not scaled"


def _length_words(compared: "Compared") -> str:
    lengths = compared.lengths
    if lengths is None:
        return f"length-measuring error not determined: {compared.no_lengths}"
    verdict = "within" if lengths.passed else "NOT within"
    return (
        f"length-measuring error {lengths.greatest_mm:+.4f} mm, {verdict} {lengths.limit_mm:g} mm "
        f"(VDI/VDE 2634-1: {len(lengths.lines)} lines, {lengths.measured} lengths)"
    )


def document(results: "Sequence[Investigation]") -> dict[str, Any]:
    """JSON document of all results; the first investigation is repeated at the top level."""
    from grabberd.core.reconstruction.accuracy.accuracy import PAPER_PRECISION, PAPER_RMSE  # noqa: PLC0415
    from grabberd.core.reconstruction.accuracy.pointing import PAPER_PX  # noqa: PLC0415

    investigations = [_investigation(result) for result in results]
    paper = {"rmse": PAPER_RMSE._asdict(), "precision": PAPER_PRECISION._asdict(), "pointing_px": PAPER_PX}
    return {**investigations[0]["single"], "paper": paper, "investigations": investigations}


def _investigation(result: "Investigation") -> dict[str, Any]:
    found = result.smoothing
    shares = {name: getattr(found.shares, name).tolist() for name in ("white", "opposite", "common")}
    return {
        "bits": result.bits,
        "single": _compared(result.single),
        "smoothed": _compared(result.smoothed),
        "smoothing": {
            "acceleration_mm_s2": sorted(set(found.acceleration_mm_s2.tolist())),
            "error_shares": shares,
            "left_out": int(found.left_out.sum()),
        },
        "pointing": result.pointing and result.pointing._asdict(),
    }


def _compared(compared: "Compared") -> dict[str, Any]:
    table = compared.accuracy
    return {
        **{name: getattr(table, name) for name in ("fields", "matched", "missing", "wrong", "unknown")},
        "rmse": table.rmse._asdict(),
        "precision": table.precision and table.precision._asdict(),
        "sigma": compared.sigma._asdict(),
        "calibration_sigma": compared.calibration_sigma._asdict(),
        "chi2": compared.chi2,
        "chi2_axes": list(compared.chi2_axes),
        "remarks": _remarks(compared),
        "fitted": table.fitted and _fit(table.fitted),
        "lengths": compared.lengths and asdict(compared.lengths) | {"passed": compared.lengths.passed},
        "no_lengths": compared.no_lengths,
    }


def _fit(motion: "RigidMotion") -> dict[str, Any]:
    return {
        "rotation": motion.rotation.tolist(),
        "shift_mm": motion.shift_mm.tolist(),
        "angle_deg": motion.angle_deg,
    }
