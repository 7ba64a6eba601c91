"""`grabberd render`: draws the estimated model, alone or over the camera's pictures."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from grabberd.cli.options import JsonOption, follow_link, out_folder

What = Literal["model", "synthetic", "overlay", "animation"]
Side = Literal["oblique", "top", "side", "front", "all"]
Colour = Literal["plain", "height", "curvature", "strain", "movement", "sigma"]


def render(  # noqa: PLR0913, PLR0917 - options of a command
    capture: Annotated[Path, typer.Argument(help="Measured capture, NAME.grab.", callback=follow_link)],
    out: Annotated[Path, out_folder("the pictures")],
    what: Annotated[
        What,
        typer.Option(
            help="model: the surface as a grid; synthetic: as the cameras would see it; overlay: the "
            "synthetic view over the camera's picture; animation: all fields in sequence."
        ),
    ] = "model",
    field: Annotated[
        int | None, typer.Option(min=0, help="Field to draw; default: the first measured.")
    ] = None,
    run: Annotated[int | None, typer.Option(min=1, help="Run to draw; default: the latest.")] = None,
    side: Annotated[Side, typer.Option(help="Viewpoint of the model.")] = "oblique",
    azimuth: Annotated[
        float | None, typer.Option("--azimuth-deg", help="Free viewpoint: angle about z, from x towards y.")
    ] = None,
    elevation: Annotated[
        float | None,
        typer.Option("--elevation-deg", min=-90, max=90, help="Free viewpoint: angle above the xy plane."),
    ] = None,
    colour: Annotated[Colour, typer.Option(help="Quantity shown by the model's colours.")] = "plain",
    reference: Annotated[
        int | None,
        typer.Option(min=0, help="Reference field of strain and movement; default: the first measured."),
    ] = None,
    size: Annotated[str, typer.Option(help="Size of the model's picture in pixels.")] = "960x600",
    of: Annotated[Literal["model", "overlay"], typer.Option(help="What to animate.")] = "model",
    format: Annotated[
        Literal["webm", "gif"], typer.Option(help="Format of an animation: WebM (VP9) or GIF.")
    ] = "webm",
    speed: Annotated[
        float, typer.Option(min=0.001, max=100, help="Speed of an animation; 1 is real time.")
    ] = 0.2,
    every: Annotated[int, typer.Option(min=1, help="Draw every Nth field of an animation.")] = 1,
    first: Annotated[int | None, typer.Option("--from", min=0, help="First field of an animation.")] = None,
    last: Annotated[int | None, typer.Option("--to", min=0, help="Last field of an animation.")] = None,
    json: JsonOption = False,
) -> None:
    """Draw a measured capture: grid model, synthetic views, overlays or an animation.

    Example: grabberd render liner.grab --what model --side all --colour curvature --out pictures

    Example: grabberd render liner.grab --what overlay --field 25 --out overlay

    Example: grabberd render liner.grab --what synthetic --azimuth-deg -60 --elevation-deg 35 --out free

    Example: grabberd render liner.grab --what animation --colour movement --speed 0.1 --out moving
    """
    from grabberd_liner.render.from_capture import Rendering  # noqa: PLC0415

    with Rendering.opened(capture, run, out, _size(size), as_json=json) as rendering:
        free = _free(azimuth, elevation)
        match what:
            case "model":
                rendering.model(field, reference, side, free, colour)
            case "synthetic" if free:
                rendering.free(field, free)
            case "synthetic" | "overlay":
                rendering.views(field, over=what == "overlay")
            case "animation":
                fields = rendering.chosen(first, last, every)
                per_s = rendering.pictures_per_s(format, speed, every)
                name = f"{of}.{format}"
                if of == "model":
                    direction = free or rendering.direction(side)
                    rendering.moving_model(fields, reference, direction, colour, name, per_s)
                else:
                    rendering.moving_overlay(fields, name, per_s)


def _free(azimuth: float | None, elevation: float | None) -> tuple[float, float] | None:
    if azimuth is None and elevation is None:
        return None
    if azimuth is None or elevation is None:
        raise typer.BadParameter("azimuth and elevation go together", param_hint="--azimuth-deg")
    return azimuth, elevation


def _size(text: str) -> tuple[int, int]:
    try:
        width, height = (int(part) for part in text.split("x"))
    except ValueError:
        width = height = 0
    if not (240 <= width <= 4096 and 160 <= height <= 4096) or width % 2 or height % 2:
        raise typer.BadParameter(
            f"{text!r}: give WIDTHxHEIGHT, even numbers from 240x160 to 4096x4096", param_hint="--size"
        )
    return width, height
