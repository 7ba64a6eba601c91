"""`grabberd jobs`: lists, shows and cancels the jobs of a running daemon."""

from typing import Annotated, Any

import typer
from rich.table import Table

from grabberd.cli.options import DEFAULT_URL, JsonOption, TokenFileOption, UrlOption, print_json, print_result
from grabberd.cli.terminal import console

JOBS = "/api/v1/jobs"
GOING_ON = ("queued", "running")
JobArgument = Annotated[str, typer.Argument(help="Id of the job, as listed: job-1772355731.")]

commands = typer.Typer(help="List, show and cancel the jobs of a running daemon.", no_args_is_help=True)


@commands.command("list")
def list_jobs(
    everything: Annotated[
        bool, typer.Option("--all", help="Include jobs that ended within the last month.")
    ] = False,
    url: UrlOption = DEFAULT_URL,
    token_file: TokenFileOption = None,
    json: JsonOption = False,
) -> None:
    """List the running and waiting jobs, in order of execution.

    Example: grabberd jobs list

    Example: grabberd jobs list --all --json
    """
    jobs = _jobs(url, token_file, everything=everything)
    if json:
        print_json(jobs)
        return
    # Narrow: with the ids of captures it has to fit a terminal of 80 columns.
    table = Table()
    for heading in ("", "job", "kind", "capture", "state"):
        table.add_column(heading, overflow="fold", no_wrap=heading in ("job", "state"))
    for job in jobs:
        place = str(job["position"] or "")
        table.add_row(place, job["id"], job["kind"], job["subject"], _state(job))
    if jobs:
        console.print(table)
    else:
        typer.echo(
            "there are no jobs" if everything else "no jobs are running or waiting; --all shows ended ones"
        )


@commands.command()
def show(
    job: JobArgument,
    url: UrlOption = DEFAULT_URL,
    token_file: TokenFileOption = None,
    json: JsonOption = False,
) -> None:
    """Show a job's state and result.

    Example: grabberd jobs show job-1772355731
    """
    found = _daemon(url, token_file).ask(_address(job))
    if json:
        print_json(found)
        return
    console.print(f"{found['id']}: {found['kind']} of {found['subject']}, {_state(found)}", highlight=False)
    place = f"position {found['position']} in the queue" if found["position"] else None
    for words in (place, _asked(found), _ended(found), _attempts(found)):
        if words:
            console.print(words, highlight=False, soft_wrap=True)
    if found["problem"]:
        console.print(f"[red]{found['problem']['message']}[/red]", soft_wrap=True)
        console.print(f"hint: {found['problem']['hint']}", soft_wrap=True)
    for name, value in (found["result"] or {}).items():
        if isinstance(value, str | int | float) and not isinstance(value, bool):
            console.print(f"{name}: {value}", highlight=False, soft_wrap=True)


@commands.command()
def cancel(
    job: JobArgument,
    url: UrlOption = DEFAULT_URL,
    token_file: TokenFileOption = None,
    json: JsonOption = False,
) -> None:
    """Cancel a running or waiting job; partial results are discarded.

    Example: grabberd jobs cancel job-1772355731
    """
    found = _daemon(url, token_file).ask(_address(job), "DELETE")
    print_result(found, f"{found['id']} is {found['state']}", as_json=json)


def _jobs(url: str, token_file: Any, *, everything: bool) -> list[dict[str, Any]]:
    jobs = list(_daemon(url, token_file).rows(JOBS, "jobs"))
    # Those that have ended are looked for from the newest on, those that wait by their turn.
    return jobs if everything else [one for one in reversed(jobs) if one["state"] in GOING_ON]


def _daemon(url: str, token_file: Any) -> Any:
    from grabberd.client.daemon import Daemon  # noqa: PLC0415

    return Daemon(url, token_file)


def _address(job: str) -> str:
    from urllib.parse import quote  # noqa: PLC0415

    return f"{JOBS}/{quote(job, safe='')}"


def _state(job: dict[str, Any]) -> str:
    return f"running {100 * job['progress']:.0f} %" if job["state"] == "running" else str(job["state"])


def _asked(job: dict[str, Any]) -> str:
    return f"requested {'by the daemon itself ' if job['automatic'] else ''}at {job['created_utc']}"


def _ended(job: dict[str, Any]) -> str | None:
    return f"ended at {job['ended_utc']}" if job["ended_utc"] else None


def _attempts(job: dict[str, Any]) -> str | None:
    return f"started {job['attempts']} times" if job["attempts"] > 1 else None
