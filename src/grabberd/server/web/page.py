"""The page's HTML document, with the data of its first view inside."""

import json
from collections.abc import Mapping
from pathlib import Path
from string import Template
from typing import Any

from grabberd.server.web.files import LANGUAGES, Edition

PAGE = Path(__file__).parent / "page.html"
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
    "connect-src 'self'; frame-src 'self'; manifest-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'self'"
)
"""The page's content security policy: nothing from another host, no script or style inside the page."""
AT_ONCE = (
    "js/core/",
    "js/shell/",
    "js/operate/",
    "js/lights/",
    "js/captures/words.js",
    "js/panels/index.js",
    "js/panels/operate.js",
)
"""Modules of the first view, preloaded: a browser finds an import only after it has read the importer."""
AFTER = ("js/live/",)
"""Modules of the picture and the curves beside it, preloaded after those: Start and Stop need neither. What
draws the curves is as large as all the rest and comes last, when they ask for it."""


def render(edition: Edition, language: str, first: Mapping[str, Any]) -> str:
    """Renders the page.

    Args:
        edition: Files that it refers to.
        language: Language of its texts: "en" or "nb".
        first: Data of its first view, so that it shows the state before it has made a request.
    """
    root = f"/static/{edition.version}"
    scripts = [name for name in edition.files if name.endswith(".js")]
    modules = [name for part in (AT_ONCE, AFTER) for name in scripts if name.startswith(part)]
    preloads = "\n".join(f'<link rel="modulepreload" href="{root}/{name}">' for name in modules)
    document = {**first, "edition": edition.version, "language": language}
    return Template(PAGE.read_text(encoding="utf-8")).substitute(
        root=root, language=language, preloads=preloads, first=_in_script(document)
    )


def language_of(accepted: str) -> str:
    """The first language of an Accept-Language header that the page has texts in; else English."""
    wanted = (part.partition(";")[0].strip().lower() for part in accepted.split(","))
    known = (_known(tag) for tag in wanted)
    return next((language for language in known if language), LANGUAGES[0])


def _known(tag: str) -> str | None:
    short = tag.partition("-")[0]
    return {"no": "nb", "nn": "nb"}.get(short, short if short in LANGUAGES else None)


def _in_script(document: Mapping[str, Any]) -> str:
    """JSON that cannot end the script element it is in, whatever texts it contains."""
    text = json.dumps(document, ensure_ascii=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")
