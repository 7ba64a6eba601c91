"""`grabberd render`: the estimated model as pictures, beside and over those of the camera."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from grabberd.cli.options import JsonOption


class What(StrEnum):
    """What can be drawn."""

    MODEL = "model"
    SYNTHETIC = "synthetic"
    OVERLAY = "overlay"
    ANIMATION = "animation"


class Side(StrEnum):
    """From where the model can be looked at by name."""

    OBLIQUE = "oblique"
    TOP = "top"
    SIDE = "side"
    FRONT = "front"
    ALL = "all"


class Colour(StrEnum):
    """What the model's colours can stand for."""

    PLAIN = "plain"
    HEIGHT = "height"
    CURVATURE = "curvature"
    STRAIN = "strain"
    MOVEMENT = "movement"
    SIGMA = "sigma"


class Moving(StrEnum):
    """What can be animated."""

    MODEL = "model"
    OVERLAY = "overlay"


class Format(StrEnum):
    """How an animation can be written."""

    WEBM = "webm"
    GIF = "gif"


def register(app: typer.Typer) -> None:
    """Adds the command."""
    app.command("render")(render)


def render(  # noqa: PLR0913, PLR0917 - options of a command
    capture: Annotated[Path, typer.Argument(help="A measured capture, NAME.grab.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="A new or empty folder.")],
    what: Annotated[
        What,
        typer.Option(
            help="model: the surface as a grid; synthetic: as the cameras would see it; overlay: that over "
            "the camera's own picture; animation: all fields, one after the other."
        ),
    ] = What.MODEL,
    field: Annotated[
        int | None, typer.Option(min=0, help="Which field; default: the first measured.")
    ] = None,
    run: Annotated[int | None, typer.Option(min=1, help="Which run's points; default: the latest.")] = None,
    side: Annotated[Side, typer.Option(help="Of the model: from where.")] = Side.OBLIQUE,
    azimuth: Annotated[
        float | None, typer.Option("--azimuth-deg", help="From anywhere: round z, from x towards y.")
    ] = None,
    elevation: Annotated[
        float | None,
        typer.Option("--elevation-deg", min=-90, max=90, help="From anywhere: above the xy plane."),
    ] = None,
    colour: Annotated[Colour, typer.Option(help="Of the model: what its colours stand for.")] = Colour.PLAIN,
    reference: Annotated[
        int | None,
        typer.Option(min=0, help="Field that strain and movement count from; default: the first measured."),
    ] = None,
    size: Annotated[str, typer.Option(help="Of the model's picture, in pixels.")] = "960x600",
    of: Annotated[Moving, typer.Option(help="Of an animation: what moves.")] = Moving.MODEL,
    format: Annotated[Format, typer.Option(help="Of an animation: WebM (VP9) or GIF.")] = Format.WEBM,
    speed: Annotated[
        float, typer.Option(min=0.001, max=100, help="Of an animation: 1 is as fast as it was.")
    ] = 0.2,
    every: Annotated[int, typer.Option(min=1, help="Of an animation: one field in so many.")] = 1,
    first: Annotated[int | None, typer.Option("--from", min=0, help="Of an animation: first field.")] = None,
    last: Annotated[int | None, typer.Option("--to", min=0, help="Of an animation: last field.")] = None,
    json: JsonOption = False,
) -> None:
    """Draw what was measured: grid model, synthetic views, both views laid over each other, an animation.

    Example: grabberd render liner.grab --what model --side all --colour curvature --out pictures

    Example: grabberd render liner.grab --what overlay --field 25 --out overlay

    Example: grabberd render liner.grab --what synthetic --azimuth-deg -60 --elevation-deg 35 --out free

    Example: grabberd render liner.grab --what animation --colour movement --speed 0.1 --out moving
    """
    from grabberd.cli.rendering import Rendering  # noqa: PLC0415

    with Rendering.opened(capture, run, out, _size(size), as_json=json) as rendering:
        free = _free(azimuth, elevation)
        match what:
            case What.MODEL:
                rendering.model(field, reference, side.value, free, colour.value)
            case What.SYNTHETIC if free:
                rendering.free(field, free)
            case What.SYNTHETIC | What.OVERLAY:
                rendering.views(field, over=what is What.OVERLAY)
            case What.ANIMATION:
                fields = rendering.chosen(first, last, every)
                per_s = rendering.pictures_per_s(speed, every)
                name = f"{of.value}.{format.value}"
                if of is Moving.MODEL:
                    direction = free or rendering.direction(side.value)
                    rendering.moving_model(fields, reference, direction, colour.value, name, per_s)
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
