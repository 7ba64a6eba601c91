"""Drawing of a capture file into picture files, for `grabberd render`."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
import typer
from numpy.typing import NDArray
from rich.progress import Progress

from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.export.pictures import MOST_PER_S, write_animation, write_pictures
from grabberd.archive.measure_setups import measure_setup
from grabberd.cli.options import print_json
from grabberd.cli.terminal import progress_console
from grabberd.core.chain.measure import MeasureSetup
from grabberd.core.field import Field, unpack
from grabberd.core.reconstruction import Points
from grabberd.errors import InputError, NotFound, NotReady
from grabberd_liner.analysis.synthetic import Agreement
from grabberd_liner.render import synthetic_view
from grabberd_liner.render.model_pictures import Gallery, Modelling
from grabberd_liner.render.wire_model import SIDES, Look

Picture = NDArray[np.uint8]
Direction = tuple[float, float]

_VIEWS = ("left", "right")


@dataclass(slots=True, eq=False)
class Rendering:
    """A run of a capture, ready to be drawn.

    Attributes:
        reader: Reader of the capture file.
        setup: Calibration, object model and settings of the run.
        points: Points by field, for fields that have any.
        out: Output folder.
        size: Width and height of the model's pictures, in pixels.
        as_json: True to print the result as JSON.
    """

    reader: CaptureReader
    setup: MeasureSetup
    points: dict[int, Points]
    out: Path
    size: tuple[int, int]
    as_json: bool

    @classmethod
    @contextmanager
    def opened(
        cls, capture: Path, run: int | None, out: Path, size: tuple[int, int], *, as_json: bool
    ) -> Iterator[Self]:
        """Open the capture file for the duration of the block.

        Raises:
            NotReady: the run has no points, or was made without calibration or object model.
        """
        with CaptureReader(capture) as reader:
            made_with = reader.run(run).made_with
            if not made_with.get("calibration") or not made_with.get("object"):
                raise NotReady(
                    f"capture {reader.meta.id} has no run with a calibration and an object model",
                    "measure it: grabberd measure CAPTURE --calibration FILE --object FILE",
                )
            points = {n: each for n, each in reader.points(run) if len(each)}
            if not points:
                raise NotReady(
                    f"no field of capture {reader.meta.id} has points",
                    "inspect its fields: grabberd export --format png",
                )
            yield cls(reader, measure_setup(made_with, made_with["settings"]), points, out, size, as_json)

    def model(
        self, field: int | None, reference: int | None, side: str, free: Direction | None, colour: str
    ) -> None:
        """Draw the grid model of one field from one viewpoint, or from all named ones."""
        n = self._field(field)
        gallery = self._gallery([self.points[n]], reference, colour)
        named = {"free": free} if free else (SIDES if side == "all" else {side: SIDES[side]})
        pictures = {
            f"model-{n}-{name}": gallery.picture(self.points[n], self._look(direction), f"field {n}")
            for name, direction in named.items()
        }
        self._write(pictures, {"field": n})

    def free(self, field: int | None, direction: Direction) -> None:
        """Draw the synthetic view of one field from a free viewpoint."""
        n = self._field(field)
        surface = self._modelling().surface(self.points[n])
        view = synthetic_view.free_view(surface, self.setup.calibration, self._grey(n), *direction, self.size)
        self._write({f"synthetic-{n}-free": synthetic_view.see_through(view.grey)}, {"field": n})

    def views(self, field: int | None, *, over: bool) -> None:
        """Draw both synthetic views of a field, alone or over the camera's picture, and report the fit."""
        n = self._field(field)
        grey, calibration = self._grey(n), self.setup.calibration
        pair = synthetic_view.synthetic_pair(self._modelling().surface(self.points[n]), calibration, grey)
        frame = synthetic_view.frame_of(pair, calibration)
        pictures = {f"synthetic-{n}": synthetic_view.see_through(frame)}
        if over:
            pictures = {
                f"overlay-{n}": synthetic_view.laid_over(frame, grey),
                f"difference-{n}": synthetic_view.difference(frame, grey),
            }
        fits = {name: _fit(fit) for name, fit in zip(_VIEWS, pair.fit, strict=True)}
        self._write(pictures, {"field": n, "fit": fits, "problems": list(pair.problems)})

    def moving_model(
        self, fields: range, reference: int | None, direction: Direction, colour: str, name: str, per_s: float
    ) -> None:
        """Animate the model; a field without points shows an empty box and a caption."""
        look = self._look(direction)
        gallery = self._gallery([self.points[n] for n in fields if n in self.points], reference, colour)
        pictures = (gallery.picture(self.points.get(n), look, self._caption(n)) for n in fields)
        self._animate(pictures, fields, name, per_s)

    def moving_overlay(self, fields: range, name: str, per_s: float) -> None:
        """Animate the synthetic views over the camera's pictures; black where there are none."""
        modelling = self._modelling()
        self._animate((self._overlay(n, modelling) for n in fields), fields, name, per_s)

    def chosen(self, first: int | None, last: int | None, every: int) -> range:
        """Choose the fields of an animation.

        Raises:
            NotFound: none of them has points.
        """
        start = min(self.points) if first is None else first
        end = max(self.points) if last is None else last
        fields = range(start, end + 1, every)
        if not any(n in self.points for n in fields):
            raise NotFound(
                f"no field from {start} to {end} of capture {self.reader.meta.id} has points",
                f"fields with points lie between {min(self.points)} and {max(self.points)}",
            )
        return fields

    def pictures_per_s(self, kind: str, speed: float, every: int) -> float:
        """Pictures per second of an animation of a format at a speed, where 1 is real time.

        Raises:
            InputError: the rate exceeds what such a file can have.
        """
        per_s = self.reader.meta.rate_hz * speed / every
        if per_s > (most := MOST_PER_S[kind]):
            raise InputError(
                f"{per_s:g} pictures per second are more than a {kind} can have, which are {most:g}",
                f"choose --every {int(np.ceil(per_s * every / most))}, or a lower --speed",
            )
        return per_s

    @staticmethod
    def direction(side: str) -> Direction:
        """Direction of a named viewpoint."""
        return SIDES.get(side, SIDES["oblique"])

    def _modelling(self) -> Modelling:
        return Modelling.of(self.setup.object_model, list(self.points.values()))

    def _gallery(self, fields: list[Points], reference: int | None, colour: str) -> Gallery:
        quantity = None if colour == "plain" else colour
        return Gallery.of(self._modelling(), fields, self.points[self._field(reference)], quantity)

    def _look(self, direction: Direction) -> Look:
        return Look(*direction, *self.size)

    def _field(self, n: int | None) -> int:
        if n is None:
            return min(self.points)
        if n not in self.points:
            known = f"fields with points lie between {min(self.points)} and {max(self.points)}"
            raise NotFound(f"field {n} of capture {self.reader.meta.id} has no points", known)
        return n

    def _grey(self, n: int) -> Field:
        return unpack(self.reader.field(n).numbered.packed)

    def _overlay(self, n: int, modelling: Modelling) -> Picture:
        calibration = self.setup.calibration
        if n not in self.points:
            return np.zeros((calibration.lines, calibration.columns, 3), np.uint8)
        grey = self._grey(n)
        # Only single pictures report how well they fit: an animation has nowhere to put it.
        pair = synthetic_view.synthetic_pair(
            modelling.surface(self.points[n]), calibration, grey, fitted=False
        )
        return synthetic_view.laid_over(synthetic_view.frame_of(pair, calibration), grey)

    def _caption(self, n: int) -> str:
        return f"field {n}   {n / self.reader.meta.rate_hz:.2f} s"

    def _animate(self, pictures: Iterable[Picture], fields: range, name: str, per_s: float) -> None:
        with Progress(console=progress_console, transient=True) as progress:
            tracked = progress.track(pictures, total=len(fields), description="drawing")
            path = write_animation(self.out, name, tracked, per_s)
        without = [n for n in fields if n not in self.points]
        self._report([path], {"pictures": len(fields), "per_s": per_s, "fields_without_points": without})

    def _write(self, pictures: dict[str, Picture], result: dict[str, Any]) -> None:
        self._report(write_pictures(self.out, pictures), result)

    def _report(self, paths: list[Path], result: dict[str, Any]) -> None:
        if self.as_json:
            print_json({"files": [str(path) for path in paths], **result})
            return
        for path in paths:
            typer.echo(str(path))
        for name, fit in (result.get("fit") or {}).items():
            if fit:
                typer.echo(f"{name} view: {_words(fit)}")
        for problem in result.get("problems") or []:
            typer.echo(f"note: {problem}", err=True)
        if result.get("fields_without_points"):
            count = len(result["fields_without_points"])
            typer.echo(f"note: {count} of the fields have no points; the animation marks them", err=True)


def _fit(fit: Agreement | None) -> dict[str, Any] | None:
    if fit is None:
        return None
    mean = fit.mean_px
    return {
        "pixels": fit.pixels,
        "rms_grey": fit.rms_grey,
        "correlation": fit.correlation,
        "targets": len(fit.places),
        "shift_x_px": float(mean.value[0]),
        "shift_y_px": float(mean.value[1]),
        "sigma_x_px": float(mean.sigma[0]),
        "sigma_y_px": float(mean.sigma[1]),
    }


def _words(fit: dict[str, Any]) -> str:
    return (
        f"the model must be shifted by x {fit['shift_x_px']:+.3f} ± {fit['sigma_x_px']:.3f}, "
        f"y {fit['shift_y_px']:+.3f} ± {fit['sigma_y_px']:.3f} px to fit the camera's picture "
        f"({fit['targets']} targets); grey values differ by {fit['rms_grey']:.1f} rms, correlation "
        f"{fit['correlation']:.3f}"
    )
