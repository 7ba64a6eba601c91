"""The documentation as a site, if this installation has it: `make site` builds it, wheels carry it."""

import base64
import hashlib
import mimetypes
import re
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

from grabberd.server.web.page import MEDIA_TYPES, OTHER, StaticFile

SITE = Path(__file__).parent / "site"
INDEX = "index.html"
HTML = "text/html; charset=utf-8"
_INLINE = re.compile(rb"<script>(.*?)</script>", re.DOTALL)
_KEPT = 32
"""Files that stay in memory, compressed: a visitor's pages, and what they share."""


class SitePage(NamedTuple):
    """A file of the site, and the content security policy it needs; "" for one that is no page."""

    file: StaticFile
    policy: str


class Site:
    """The site's files, read from the disk as they are asked for.

    Addresses are looked up among the names of the files that there are: none of them reaches the file system.
    """

    def __init__(self, folder: Path = SITE) -> None:
        self._folder = folder
        self._names: dict[str, Path] = {}
        self._listed_ns = -1

    @property
    def is_built(self) -> bool:
        """True if this installation has the site."""
        return INDEX in self._files()

    def is_folder(self, path: str) -> bool:
        """True for a page whose address lacks its last slash, which its links count on."""
        return f"{path}/{INDEX}" in self._files()

    def find(self, path: str) -> SitePage | None:
        """The file at an address below the site's own; None if there is none."""
        name = path + INDEX if path == "" or path.endswith("/") else path
        place = self._files().get(name)
        return None if place is None else _read(place, place.stat().st_mtime_ns)

    def _files(self) -> dict[str, Path]:
        """The files by their names, listed again when the site was built again."""
        index = self._folder / INDEX
        built_ns = index.stat().st_mtime_ns if index.is_file() else 0
        if built_ns != self._listed_ns:
            found = self._folder.rglob("*") if built_ns else ()
            self._names = {
                path.relative_to(self._folder).as_posix(): path for path in found if path.is_file()
            }
            self._listed_ns = built_ns
        return self._names


@lru_cache(maxsize=_KEPT)
def _read(path: Path, _changed_ns: int) -> SitePage:
    content = path.read_bytes()
    guessed = mimetypes.types_map.get(path.suffix, OTHER)
    media_type = HTML if path.suffix == ".html" else MEDIA_TYPES.get(path.suffix, guessed)
    return SitePage(StaticFile(media_type, content), _policy(content) if path.suffix == ".html" else "")


def _policy(page: bytes) -> str:
    """Allows the page's own scripts by their digests, the site's files, and nothing from another host."""
    digests = (base64.b64encode(hashlib.sha256(text).digest()).decode() for text in _INLINE.findall(page))
    scripts = " ".join(f"'sha256-{one}'" for one in digests)
    return (
        f"default-src 'none'; script-src 'self' {scripts}; style-src 'self'; img-src 'self' data:; "
        "connect-src 'self'; worker-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
    )
