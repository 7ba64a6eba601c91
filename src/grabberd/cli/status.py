"""`grabberd status`: shows what the daemon is doing."""

from collections.abc import Iterator
from typing import Any

from rich.table import Table

from grabberd.cli.options import DEFAULT_URL, JsonOption, TokenFileOption, UrlOption, print_json
from grabberd.cli.terminal import console


def status(
    url: UrlOption = DEFAULT_URL, token_file: TokenFileOption = None, json: JsonOption = False
) -> None:
    """Show the daemon's devices and loggers: state, fields, losses, ring, points, vacuum.

    Example: grabberd status --url http://127.0.0.1:8050
    """
    from grabberd.client.daemon import Daemon  # noqa: PLC0415

    state = Daemon(url, token_file).ask("/api/v1/state")
    if json:
        print_json(state)
        return
    table = Table("device", "state", "received", "lost", "points", "bits", "threshold", "capture")
    for name, device in state["devices"].items():
        live = device["live"] or {"points": "–"}
        lost = sum(count for outcome, count in device["fields"].items() if outcome != "received")
        ring = device["ring"]
        cells = (device["fields"]["received"], lost, live["points"], ring["bits"], ring["threshold"])
        table.add_row(name, device["state"], *(str(cell) for cell in cells), device["capture_id"] or "–")
    console.print(table)
    # soft_wrap: where the output is piped, rich would break these lines at 80 columns.
    for name, device in state["devices"].items():
        for words in _remarks(device):
            console.print(f"{name}: {words}", highlight=False, soft_wrap=True)
    for name, logger in state.get("loggers", {}).items():  # a daemon of an earlier version has none
        console.print(f"logger {name}: {_logger_words(logger)}", highlight=False, soft_wrap=True)
    console.print(disk_words(state["storage"]), highlight=False, soft_wrap=True)
    for words in fault_words(state["faults"]):
        console.print(words, highlight=False, soft_wrap=True)


def disk_words(storage: dict[str, Any]) -> str:
    """One line on the free disk space."""
    if storage["problem"]:
        return f"disk: {storage['problem']}"
    free_gb = storage["free_bytes"] / 1e9
    return f"disk: {free_gb:.1f} GB free, {storage['minutes_left']:.0f} minutes of capture left"


def fault_words(faults: list[dict[str, Any]]) -> list[str]:
    """A line for each fault of the daemon itself."""
    return [f"{one['level']} since {one['since_utc']}: {one['message']}; {one['hint']}" for one in faults]


def _remarks(device: dict[str, Any]) -> Iterator[str]:
    """Remarks that do not fit into the table."""
    if device["cause"]:
        yield "; ".join(words for words in (device["cause"], device["hint"]) if words)
    if device["computer"]["cause"]:
        yield f"{device['computer']['cause']}; {device['computer']['hint']}"
    rate = device.get("health", {}).get("parts", {}).get("rate")
    if rate and rate["level"] in {"warning", "bad"}:
        yield f"{rate['message']}; {rate['hint']}"
    if any(device["losses"].values()):
        yield f"not received, by cause: {_counted(device['losses'])}"
    if any(device["rebases"].values()):
        yield f"numbers and times go by something else, changes: {_counted(device['rebases'])}"
    if any(device["recoveries"].values()):
        latest = f"the last on {device['last_failure_utc']}: {device['last_failure']}"
        yield f"recoveries: {_counted(device['recoveries'])}; {latest}"
    yield from device["warnings"]


def _logger_words(logger: dict[str, Any]) -> str:
    """One line on a data logger: its present values, or why there are none, and what else it said."""
    shown = [
        f"{name} {one['kpa']:.1f} kPa" for name, one in logger["channels"].items() if one["kpa"] is not None
    ]
    state = ", ".join(filter(None, (logger["state"], logger["cause"])))
    words = [state, *shown]
    if logger["anomalies"]:
        words.append(f"anomalies: {_counted(logger['anomalies'])}")
    return "; ".join(words)


def _counted(counts: dict[str, int]) -> str:
    """E.g. "cable 2, computer 30"."""
    return ", ".join(f"{what} {count}" for what, count in counts.items() if count)
