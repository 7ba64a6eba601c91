"""`grabberd points`: prints the points of a running daemon's fields as they are measured."""

import json
from collections.abc import Iterator
from itertools import islice
from typing import TYPE_CHECKING, Annotated

import typer

from grabberd.cli.options import DEFAULT_URL, JsonOption, TokenFileOption, UrlOption, end_as_ctrl_c_does

if TYPE_CHECKING:
    from grabberd.client.points_stream import StreamedPoints

AXES = "xyz"
COLUMNS = (
    *("n", "time_ns", "target"),
    *(f"{axis}_mm" for axis in AXES),
    *(f"sigma_{axis}_mm" for axis in AXES),
    "residual_px",
)


def points(
    device: Annotated[
        str | None, typer.Option(help="Name of the device; not needed if there is only one.")
    ] = None,
    fields: Annotated[
        int | None, typer.Option(min=1, help="Number of fields; default: until Ctrl-C.")
    ] = None,
    url: UrlOption = DEFAULT_URL,
    token_file: TokenFileOption = None,
    as_json: JsonOption = False,
) -> None:
    """Print the points of every field the daemon measures, as CSV with standard deviations.

    With --json, one line per field, including the covariances.

    Example: grabberd points --fields 500 > points.csv

    Example: grabberd points --device north --url http://barn.local:8050 --token-file token --json
    """
    from grabberd.client.daemon import Daemon  # noqa: PLC0415
    from grabberd.client.points_stream import follow_points  # noqa: PLC0415

    end_as_ctrl_c_does()
    skipped = 0
    try:
        if not as_json:
            typer.echo(",".join(COLUMNS))
        for one in islice(follow_points(Daemon(url, token_file), device), fields):
            skipped += one.skipped
            typer.echo(_as_json(one) if as_json else "\n".join(_rows(one)))
    except KeyboardInterrupt:
        pass
    finally:
        if skipped:
            typer.echo(f"{skipped} fields are missing: printing was too slow", err=True)


def _rows(one: "StreamedPoints") -> Iterator[str]:
    frame = one.frame
    sigmas_mm = frame.covariance_mm2[:, [0, 3, 5]] ** 0.5
    for k, target in enumerate(frame.target.tolist()):
        xyz, sigmas = frame.xyz_mm[k].tolist(), sigmas_mm[k].tolist()
        values = *(f"{value:.4f}" for value in (*xyz, *sigmas)), f"{frame.residual_px[k]:.4f}"
        yield ",".join((f"{frame.n}", f"{frame.time_ns}", f"{target}", *values))


def _as_json(one: "StreamedPoints") -> str:
    frame = one.frame._asdict()
    arrays = {key: value.tolist() for key, value in frame.items() if hasattr(value, "tolist")}
    own = {"device": one.description.device, "calibration_id": one.description.calibration_id}
    return json.dumps({**own, "skipped": one.skipped, **frame, **arrays}, separators=(",", ":"))
