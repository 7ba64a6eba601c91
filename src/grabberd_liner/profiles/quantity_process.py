"""Checks the quantities of a profile in a process of its own: what reads them would stay in the daemon."""

from grabberd.documents.named_types import JsonObject
from grabberd.work.own_process import OwnProcesses, answer_with

PROGRAM = f"from {__name__} import main; main()"
_CHECKED = frozenset({"material", "obtained", "analysis", "pulsation", "liner"})
"""Keys under which there are such quantities."""


def problems_in_process(processes: OwnProcesses, content: JsonObject) -> list[str]:
    """Problems of the quantities in a profile's document.

    Raises:
        StorageError: The process cannot be started, or does not answer in time.
    """
    if not _CHECKED & content.keys():
        return []
    # Dates and the like, which YAML knows and JSON does not, are refused as texts as well.
    found: list[str] = processes.ask(PROGRAM, content, "checks profiles")
    return found


def main() -> None:
    """Answers the document on standard input with its problems."""
    from grabberd_liner.chain.analysis.profile import quantity_problems  # noqa: PLC0415 - heavy

    answer_with(quantity_problems)
