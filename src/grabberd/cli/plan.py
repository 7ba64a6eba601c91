"""`grabberd plan`: predicts the σ of X, Y, Z before a rig is built."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from rich.markup import escape
from rich.table import Table

from grabberd.cli.options import ConfigOption, JsonOption, load, print_json
from grabberd.cli.terminal import console

if TYPE_CHECKING:
    from grabberd.config import DeviceConfig
    from grabberd.core.chain.plan import Lines, Plan, PlannedPlace, PlanSettings
    from grabberd.core.geometry import NominalRig, Rig
    from grabberd.core.reconstruction import ObjectModel
    from grabberd.extension import Advice

COLUMNS = ("X", "Y", "Z", "XYZ", "calibration's XYZ")
USUAL_FRAME = "calibration-frames/paper-108.yaml"


def plan(  # noqa: PLR0913, PLR0917 - options of a command
    config: ConfigOption = None,
    device: Annotated[
        str | None, typer.Option(help="A configured device; required if there are several.")
    ] = None,
    calibration_frame: Annotated[
        Path | None, typer.Option(help="Calibration frame (YAML); default: the paper's, with 108 targets.")
    ] = None,
    calibration: Annotated[
        Path | None, typer.Option(help="Calibration (JSON) to use instead of the nominal rig.")
    ] = None,
    object_model: Annotated[
        Path | None,
        typer.Option(
            "--object", help="Object model (YAML) whose bounding box is the volume; default: as configured."
        ),
    ] = None,
    bits: Annotated[
        int | None, typer.Option(min=1, max=8, help="Bits per pixel; default: as configured.")
    ] = None,
    lines: Annotated[
        Literal["doubled", "field", "progressive"] | None,
        typer.Option(
            help="Lines of a field, or progressive: all lines of a picture. Default: as configured; "
            "progressive where the rig's lines are not those of interlaced video."
        ),
    ] = None,
    noise: Annotated[
        float, typer.Option(min=0, max=0.5, help="Noise of a pixel, as a fraction of the contrast.")
    ] = 0.02,
    sigma_px: Annotated[
        tuple[float, float] | None,
        typer.Option(help="Pointing precision in x and y including line jitter, if known."),
    ] = None,
    json: JsonOption = False,
) -> None:
    """Predict the σ of X, Y and Z over the volume, and what changes of rig, bits and targets would give.

    Example: grabberd plan --config configs/fake.yaml --bits 8
    """
    from grabberd import extension  # noqa: PLC0415
    from grabberd.archive.measure_setups import nominal_rig  # noqa: PLC0415
    from grabberd.config import default_config_file, only_device, shipped_configs  # noqa: PLC0415
    from grabberd.core.chain import plan as planning  # noqa: PLC0415
    from grabberd.core.geometry import Rig  # noqa: PLC0415

    if sigma_px and not min(sigma_px) > 0:
        raise typer.BadParameter("a standard deviation must be greater than 0", param_hint="--sigma-px")
    known = load(config)
    chosen = known.devices[only_device(known, device, config or default_config_file())]
    model = _model(object_model or chosen.object)
    frame = _model(calibration_frame) or _model(shipped_configs() / USUAL_FRAME)
    assert frame is not None
    settings = _settings(chosen, model or frame, bits, lines, noise, sigma_px)
    low, high = ((model or frame).xyz_mm.min(axis=0), (model or frame).xyz_mm.max(axis=0))
    nominal = nominal_rig(chosen.rig)

    def rig_of(one: "NominalRig", wanted: "PlanSettings") -> Rig:
        return Rig.of(planning.nominal_calibration(one, frame, wanted))

    rig = _calibrated(calibration) if calibration else rig_of(nominal, settings)
    expected = planning.plan(rig, low, high, settings)
    influence = [
        (name, planning.plan(rig_of(one, wanted), low, high, wanted).places[0])
        for name, one, wanted in planning.variations(nominal, settings)
    ]
    advice = [extension.load(one.advice)(model) for one in extension.extensions() if one.advice]
    if json:
        advised = [{"title": one.title, "note": one.note, "figures": one.figures} for one in advice]
        print_json({**_document(expected, influence), "advice": advised})
    else:
        _show(expected, influence)
        for one in advice:
            _show_advice(one)


def _model(file: Path | None) -> "ObjectModel | None":
    from grabberd.core.reconstruction import ObjectModel  # noqa: PLC0415
    from grabberd.files.reading import read_documents  # noqa: PLC0415

    return None if file is None else ObjectModel.from_document(read_documents(None, file)["object"])


def _calibrated(file: Path) -> "Rig":
    from grabberd.core.geometry import Calibration, Rig  # noqa: PLC0415
    from grabberd.files.reading import read_documents  # noqa: PLC0415

    return Rig.of(Calibration.from_document(read_documents(file, None)["calibration"]))


def _settings(
    device: "DeviceConfig",
    model: "ObjectModel",
    bits: int | None,
    lines: "Lines | None",
    noise: float,
    sigma_px: tuple[float, float] | None,
) -> "PlanSettings":
    from grabberd.core.chain.plan import PlanSettings  # noqa: PLC0415
    from grabberd.core.field import VIDEO_LINES  # noqa: PLC0415

    wanted = device.ring.bits if bits is None else bits
    usual = device.ring.lines if bits is None else None
    of_video: Lines = usual or ("doubled" if wanted == 1 else "field")
    kept = lines or (of_video if device.rig.lines in VIDEO_LINES else "progressive")
    return PlanSettings(
        target_diameter_mm=model.target_diameter_mm,
        bits=wanted,
        lines=kept,
        noise=noise,
        spread_px=device.spread_px,
        line_jitter_px=device.line_jitter_px,
        sigma_px=sigma_px,
    )


def _show(expected: "Plan", influence: "Sequence[tuple[str, PlannedPlace]]") -> None:
    places = [(place.name, place) for place in expected.places]
    for title, where, rows in (
        ("Expected for a single field", "σ in mm at", places),
        ("Effect of changes", "σ in mm at the centre", influence),
    ):
        table = Table(where, *COLUMNS, title=title)
        for name, place in rows:
            table.add_row(name, *_cells(place))
        console.print(table)
    (x, y), (along, across) = expected.sigma_px, expected.mm_per_px
    console.print(
        f"pointing {x:.3f} px in x, {y:.3f} px in y; {along:.3f} mm/px along the lines, {across:.3f} across",
        highlight=False,
        soft_wrap=True,
    )


def _show_advice(advice: "Advice") -> None:
    table = Table(*map(escape, advice.heads), title=advice.title)
    for cells in advice.rows:
        table.add_row(*cells)
    console.print(table)
    console.print(advice.note, highlight=False, soft_wrap=True)


def _cells(place: "PlannedPlace") -> list[str]:
    if place.pointing is None:
        return ["not seen by both views", "", "", "", ""]
    share = f"{place.calibration.xyz_mm:.4f}" if place.calibration else "not known"
    return [*(f"{value:.4f}" for value in place.pointing), share]


def _document(expected: "Plan", influence: "Sequence[tuple[str, PlannedPlace]]") -> dict[str, Any]:
    return {
        "sigma_px": expected.sigma_px,
        "mm_per_px": expected.mm_per_px,
        "places": [_place(place) for place in expected.places],
        "influence": [{**_place(place), "name": name} for name, place in influence],
    }


def _place(place: "PlannedPlace") -> dict[str, Any]:
    shares = {name: getattr(place, name) for name in ("pointing", "calibration")}
    return {**place._asdict(), **{name: axes and axes._asdict() for name, axes in shares.items()}}
