"""A page in a browser of its own, that is watched: for errors, and for what it asks of whom."""

import time
from typing import Any
from urllib.parse import urlsplit

TABLET = {"width": 1024, "height": 768}
PATIENCE_MS = 120_000

# Loading all panels ahead takes as much of the processor as opening the page does.
SAVE_DATA = """Object.defineProperty(NetworkInformation.prototype, 'saveData', { get: () => true });"""


def until(page: Any, script: str, argument: Any = None) -> None:
    """Until a function of the page says so. Asked from here: its policy lets nobody evaluate text in it."""
    end_s = time.monotonic() + PATIENCE_MS / 1000
    while not page.evaluate(script, argument):
        assert time.monotonic() < end_s, f"never true: {script}"
        page.wait_for_timeout(50)


def touch(page: Any, *fingers: tuple[tuple[float, float], tuple[float, float]], steps: int = 6) -> None:
    """Fingers that go down together, move each from one place of the window to another, and are lifted."""
    devtools = page.context.new_cdp_session(page)

    def at(part: float) -> list[dict[str, float]]:
        return [
            {"x": x + part * (to_x - x), "y": y + part * (to_y - y), "id": number}
            for number, ((x, y), (to_x, to_y)) in enumerate(fingers)
        ]

    devtools.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": at(0.0)})
    for step in range(1, steps + 1):
        devtools.send("Input.dispatchTouchEvent", {"type": "touchMove", "touchPoints": at(step / steps)})
    devtools.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    devtools.detach()


def spread(page: Any, place: Any) -> None:
    """Two fingers on an element go apart along its middle."""
    box = place.bounding_box()
    x, y, far = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2, 0.3 * box["width"]
    touch(page, ((x - 30, y), (x - far, y)), ((x + 30, y), (x + far, y)))


class Watched:
    """A page of the daemon, open in a fresh browser context, which saves data unless panels shall load ahead.

    Attributes:
        page: playwright's.
        errors: what its console said was wrong and at which address, and what was thrown.
        foreign: addresses of other hosts that it asked for.
    """

    def __init__(
        self,
        browser: Any,
        url: str,
        *,
        size: dict[str, int] = TABLET,
        look: str = "light",
        language: str = "en",
        cookies: list[dict[str, Any]] | None = None,
        ready: str = "[data-panel], .sign-in",
        ahead: bool = False,
    ) -> None:
        self.context = browser.new_context(
            viewport=size, color_scheme=look, locale=language, accept_downloads=True
        )
        self.context.add_cookies(cookies or [])
        self.context.set_default_timeout(PATIENCE_MS)
        if not ahead:
            self.context.add_init_script(SAVE_DATA)
        self.page = self.context.new_page()
        self.errors: list[tuple[str, str]] = []
        self.foreign: list[str] = []
        self.expected: tuple[str, ...] = ()
        self._host = urlsplit(url).netloc
        self.page.on("pageerror", lambda error: self.errors.append((str(error), "")))
        self.page.on("console", self._hear)
        self.page.on("request", self._see)
        self.page.goto(url)
        self.page.wait_for_selector(ready)

    def expect_errors(self, *parts: str) -> None:
        """Errors with one of these words in them belong to the test."""
        self.expected += parts

    def check(self) -> None:
        """Nothing was wrong, and nobody else was asked; all that was said is in the assertion's words."""
        assert self.foreign == []
        wrong = [(text, at) for text, at in self.errors if not any(part in text for part in self.expected)]
        assert not wrong, "\n".join(f"{text} {at}" for text, at in wrong)

    def close(self) -> None:
        self.context.close()

    def _hear(self, message: Any) -> None:
        if message.type == "error":
            self.errors.append((message.text, message.location.get("url", "")))

    def _see(self, request: Any) -> None:
        place = urlsplit(request.url)
        if place.scheme in ("http", "https", "ws", "wss") and place.netloc != self._host:
            self.foreign.append(request.url)
