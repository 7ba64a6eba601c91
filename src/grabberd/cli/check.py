"""`grabberd check`: checks whether the calibration still holds."""

import time
from pathlib import Path
from typing import Annotated, Any
from urllib.parse import quote

import typer
from rich.table import Table

from grabberd.cli import EX_BAD_VERDICT
from grabberd.cli.options import DEFAULT_URL, JsonOption, TokenFileOption, UrlOption, follow_link, print_json
from grabberd.cli.terminal import console, progress_bar
from grabberd.errors import GrabberdError, InputError

POLL_S = 0.2


def check(
    capture: Annotated[
        Path | None,
        typer.Argument(
            help="Capture of the calibration frame; default: the daemon records one.", callback=follow_link
        ),
    ] = None,
    calibration: Annotated[
        Path | None, typer.Option(help="Calibration to check (JSON); default: the capture's.")
    ] = None,
    calibration_frame: Annotated[
        Path | None,
        typer.Option(help="Targets of the calibration frame (YAML); default: the only known one."),
    ] = None,
    in_place: Annotated[
        bool, typer.Option("--in-place", help="The frame stands exactly where it stood for the calibration.")
    ] = False,
    device: Annotated[
        str | None, typer.Option(help="Device to check; not needed if there is only one.")
    ] = None,
    url: UrlOption = DEFAULT_URL,
    token_file: TokenFileOption = None,
    json: JsonOption = False,
) -> None:
    """Check whether the calibration still holds, by watching the calibration frame for ten seconds.

    Exit code 0: it fits; 3: it is doubtful or does not fit.

    Example: grabberd check

    Example: grabberd check frame.grab --calibration rig.calibration.json
    """
    frame = _frame(calibration_frame)
    if capture is None:
        found = _through_daemon(url, device, frame, token_file, in_place=in_place)
    else:
        found = _of_file(capture, calibration, frame, in_place=in_place)
    if json:
        print_json(found)
    else:
        _show(found)
    if found["verdict"] != "fits":
        raise typer.Exit(EX_BAD_VERDICT)


def _frame(path: Path | None) -> dict[str, Any] | None:
    from grabberd.files.reading import read_yaml  # noqa: PLC0415

    return None if path is None else read_yaml(path)


def _of_file(
    capture: Path, calibration: Path | None, frame: dict[str, Any] | None, *, in_place: bool
) -> dict[str, Any]:
    from grabberd.archive.calibrations.calibration_catalog import calibration_frame_document  # noqa: PLC0415
    from grabberd.files.reading import read_documents  # noqa: PLC0415
    from grabberd.library.jobs.calibration_frame import check_file  # noqa: PLC0415

    with progress_bar("checking") as progress:
        found = check_file(
            progress,
            path=capture,
            calibration_frame=calibration_frame_document(frame),
            calibration=read_documents(calibration, None)["calibration"],
            in_place=in_place,
        )
    return found.model_dump(mode="json")


def _through_daemon(
    url: str, device: str | None, frame: dict[str, Any] | None, token_file: Path | None, *, in_place: bool
) -> dict[str, Any]:
    from grabberd.client.daemon import Daemon  # noqa: PLC0415

    daemon = Daemon(url, token_file)
    name = device or _only(daemon.ask("/api/v1/devices")["devices"])
    request = {"calibration_frame": frame, "in_place": in_place}
    job = daemon.ask(f"/api/v1/devices/{quote(name, safe='')}/check", "POST", request)
    with progress_bar("watching the calibration frame") as progress:
        while job["state"] in ("queued", "running"):
            time.sleep(POLL_S)
            job = daemon.ask(f"/api/v1/jobs/{job['id']}")
            progress(job["progress"])
    if job["state"] != "done":
        problem = job["problem"] or {
            "message": f"the check was {job['state']}",
            "hint": "run the check again",
        }
        raise GrabberdError(problem["message"], problem["hint"])
    return dict(job["result"])


def _only(devices: list[dict[str, Any]]) -> str:
    names = [str(one["name"]) for one in devices]
    if len(names) != 1:
        raise InputError(f"there are several devices: {', '.join(names)}", "choose one with --device")
    return names[0]


def _show(found: dict[str, Any]) -> None:
    table = Table("", "left", "right", title=f"Calibration {found['calibration']}: {found['verdict']}")
    for name, key in (("images moved", "shift_px"), ("residuals", "residual_px")):
        for axis in ("x", "y"):
            table.add_row(
                f"{name} {axis}, px", *(f"{found[key][view][axis]:+.2f}" for view in ("left", "right"))
            )
    console.print(table)
    rmse = found["rmse"]
    words = ", ".join(f"{axis.upper()} {rmse[f'{axis}_mm']:.3f}" for axis in ("x", "y", "z", "xyz"))
    console.print(f"RMSE in mm: {words}; χ² {found['chi2']:.2f} (1: as accurate as the calibration predicts)")
    console.print(f"{found['seen']} of {found['of']} targets seen in both views, {found['fields']} fields")
    for reason in found["reasons"]:
        console.print(f"[yellow]{reason}[/yellow]")
    console.print(found["advice"])
