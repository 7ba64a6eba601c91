"""What a new user types on the first day, how long it takes, and the page that tells of it."""

import re
import shlex
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from proofs.vm.guest import first_day
from proofs.vm.machine import Machine

INTRODUCTION = """# The first day

Written by `make test-vm-deb WRITE=1`: a new user's way on a fresh Debian 12 without internet, in a virtual
machine, typed by a program as root, in a folder that has the package and the wheels of a notebook. The
grabber is the kernel's test device; into it are played, through the kernel and bit for bit, pictures of the
calibration frame and then of a liner before the same simulated camera and mirrors.
`notebook.py` runs all cells of a notebook, as Jupyter does.

Seconds *there* are those of the machine, whose clock counts its own instructions: one takes a nanosecond,
so a computer of today needs a tenth to a third of them. Seconds *here* are those of the computer that
simulated it, on one of {processors} processors that others wanted as well.
"""
LAST = """The computer was started again, without the grabber; the page in the browser of another one:

![The page: no grabber](../images/first-day.png)
"""
LEAST_S = 0.5
"""Less is not told."""
_SECRET = re.compile(r"grabberd_[\w-]{20,}")


@dataclass
class Line:
    """One line that was typed, or in words what else was done or waited for (a comment)."""

    text: str
    is_typed: bool
    there_s: float
    here_s: float


@dataclass
class Stage:
    """A part of the way, with what it ended with, in words."""

    title: str
    lines: list[Line] = field(default_factory=list)
    ended_with: list[str] = field(default_factory=list)

    @property
    def there_s(self) -> float:
        """Seconds of the machine."""
        return sum(line.there_s for line in self.lines)

    @property
    def here_s(self) -> float:
        """Seconds of the computer that simulates it."""
        return sum(line.here_s for line in self.lines)


class Walk:
    """Types line after line, and keeps what it took.

    Attributes:
        machine: where it is typed.
        stages: the parts so far.
    """

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self.stages: list[Stage] = []

    def begin(self, title: str) -> None:
        """What follows belongs to another part."""
        self.stages.append(Stage(title))

    def types(self, line: str, timeout_s: float = 1500) -> str:
        """Types a line, which has to succeed; what it said."""
        done = self._timed(line, True, first_day.type_in, line=line, timeout_s=timeout_s)
        assert done["exit"] == 0, f"{line}\n{done['said']}"
        said: str = done["said"]
        return said

    def waits(self, until: str, function: Callable[..., Any], **arguments: Any) -> Any:
        """Calls a function of the guest's that waits for something, or looks at it, as a person would."""
        return self._timed(until, False, function, timeout_s=1500, **arguments)

    def ends_with(self, words: str) -> None:
        """What this part ended with."""
        self.stages[-1].ended_with.append(words)

    def document(self, processors: int) -> str:
        """The page."""
        head = INTRODUCTION.format(processors=processors)
        return "\n".join([head, *self._table(), "", *self._stages(), LAST])

    def _timed(self, text: str, is_typed: bool, function: Callable[..., Any], **arguments: Any) -> Any:
        result = self.machine.call(function, **arguments)
        _, there_s, here_s = self.machine.calls[-1]
        self.stages[-1].lines.append(Line(text, is_typed, there_s, here_s))
        return result

    def _table(self) -> Iterator[str]:
        yield "| | there | here | |\n|---|---|---|---|"
        for stage in self.stages:
            end = "; ".join(stage.ended_with)
            yield f"| {stage.title} | {stage.there_s:.0f} s | {stage.here_s:.0f} s | {end} |"
        there, here = (sum(getattr(stage, name) for stage in self.stages) for name in ("there_s", "here_s"))
        yield f"| all | {there:.0f} s | {here:.0f} s | |"

    def _stages(self) -> Iterator[str]:
        for stage in self.stages:
            yield f"## {stage.title}\n"
            for line in stage.lines:
                seconds = f"{line.there_s:.1f} s" if line.there_s >= LEAST_S else ""
                if line.is_typed:
                    yield f"    {_SECRET.sub('TOKEN', line.text)}" + (f"    # {seconds}" if seconds else "")
                else:
                    yield f"    # {line.text}" + (f": {seconds}" if seconds else "")
            yield ""


def curl(method: str, path: str, body: str, *, to: str = "") -> str:
    """The line that asks the daemon for something, as the documentation has it."""
    address = f"http://127.0.0.1:8050/api/v1/{path}"
    head = "-H 'Content-Type: application/json'"
    return f"curl -sS --fail-with-body -X {method} {address} {head} -d {shlex.quote(body)}{to}"


def screenshot(chromium: str, name: str, port: int, token: str, picture: Path) -> list[str]:
    """Signs in on the page of a machine of this name and takes its picture; what went wrong in its scripts.

    The name leads to a port of this computer's loopback, as a name server would have it.
    """
    from playwright.sync_api import sync_playwright  # noqa: PLC0415

    errors: list[str] = []
    with sync_playwright() as playwright:
        names = f"--host-resolver-rules=MAP {name} 127.0.0.1"
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox", names])
        page = browser.new_page(viewport={"width": 1024, "height": 768}, locale="en")
        page.set_default_timeout(300_000)
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.goto(f"http://{name}:{port}/")
        page.get_by_label("Token").fill(token)
        page.get_by_role("button", name="Sign in").click()
        page.get_by_role("button", name="Start").wait_for()
        page.locator("[data-panel]").first.wait_for()
        page.screenshot(path=picture)
        browser.close()
    return errors
