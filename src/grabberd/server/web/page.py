"""The operator's page with the data of its first view, its static files, and the documentation's site.

Each file has its ETag and is compressed once; all are under one version.
"""

import base64
import gzip
import hashlib
import json
import mimetypes
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from string import Template
from typing import Any, NamedTuple

STATIC = Path(__file__).parent / "static"
LANGUAGES = ("en", "nb")
STYLES = "page.css"
JOINED = ("css/", "texts/")
FIRST_TEXTS = ("captures", "causes", "core", "jobs", "lights", "live", "operate", "plots", "signin")
"""Catalogues that the first view needs. The others are twice as large, and are fetched after it."""
LAYERS = "css/base.css"
"""Declares the order of the cascade layers, so it comes before every sheet that uses one."""
MEDIA_TYPES = {
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".json": "application/json",
    ".svg": "image/svg+xml",
    ".txt": "text/plain; charset=utf-8",
}
OTHER = "application/octet-stream"
COMMENTS = re.compile(rb"^[ \t]*(?://.*$|/\*[\s\S]*?\*/)", re.MULTILINE)
"""Comments that begin a line."""


@dataclass(frozen=True)
class StaticFile:
    """A file, or several joined into one.

    Attributes:
        media_type: Value of the Content-Type header.
        content: Bytes of the file.
    """

    media_type: str
    content: bytes

    @cached_property
    def compressed(self) -> bytes:
        """The content by gzip, at the highest level; the same bytes every time."""
        return gzip.compress(self.content, 9, mtime=0)  # a time stamp inside would differ after each restart

    @cached_property
    def etag(self) -> str:
        """Strong entity tag, a digest of the content."""
        return f'"{hashlib.sha256(self.content).hexdigest()[:32]}"'


@dataclass(frozen=True)
class Edition:
    """All files as they were at one moment.

    Attributes:
        version: Digest of all files; it is part of their addresses, so that browsers may keep them for ever.
        files: Files by their path below `static/`.
    """

    version: str
    files: Mapping[str, StaticFile]


class Files:
    """The files of a folder, read again when one of them has changed, as after an upgrade.

    Attributes:
        edition: All files as they were when last read; None before that.
    """

    def __init__(self, folder: Path = STATIC) -> None:
        self._folder = folder
        self._stamp: tuple[tuple[str, int, int], ...] = ()
        self.edition: Edition | None = None

    def newest(self) -> Edition:
        """All files as they are now."""
        stamp = tuple(_stamp(str(self._folder)))
        if self.edition is None or stamp != self._stamp:
            self.edition, self._stamp = _edition(self._folder), stamp
        return self.edition


def _paths(folder: Path) -> list[Path]:
    found = (path for path in folder.rglob("*") if path.is_file() and not path.name.startswith("."))
    return sorted(found)


def _stamp(folder: str) -> Iterator[tuple[str, int, int]]:
    # Not by Path: it is looked at before every visit, and a Path for each of 250 files takes 10 ms.
    with os.scandir(folder) as entries:
        for entry in sorted(entries, key=lambda one: one.name):
            if entry.is_dir():
                yield from _stamp(entry.path)
            elif not entry.name.startswith("."):
                stat = entry.stat()
                yield entry.path, stat.st_mtime_ns, stat.st_size


def _edition(folder: Path) -> Edition:
    names = [path.relative_to(folder).as_posix() for path in _paths(folder)]
    read = {name: _file(folder, name) for name in names}
    # What is served joined is not served in its parts, too.
    whole = {name: file for name, file in read.items() if not name.startswith(JOINED)}
    files = whole | {STYLES: _styles(read)} | _all_texts(read)
    return Edition(_version(files), files)


def _file(folder: Path, name: str) -> StaticFile:
    path = folder / name
    content = path.read_bytes()
    # A third of a compressed module is comments, of no use to a tablet. Libraries keep their licences.
    served = _without_comments(content) if name.startswith(("js/", "css/")) else content
    return StaticFile(MEDIA_TYPES.get(path.suffix, OTHER), served)


def _without_comments(module: bytes) -> bytes:
    """A module with empty lines in place of its comments: what a browser says of line 40 is about line 40."""
    return COMMENTS.sub(lambda comment: b"\n" * comment[0].count(b"\n"), module)


def _version(files: Mapping[str, StaticFile]) -> str:
    digest = hashlib.sha256()
    for name in sorted(files):
        digest.update(f"{name} {files[name].etag}\n".encode())
    return digest.hexdigest()[:16]


def _styles(files: Mapping[str, StaticFile]) -> StaticFile:
    """All style sheets in one, in the order of their names; those of vendored libraries first."""
    own = sorted(_below(files, "css/", ".css"), key=lambda name: (name != LAYERS, name))
    names = [*_below(files, "vendor/", ".css"), *own]
    return StaticFile(MEDIA_TYPES[".css"], b"\n".join(files[name].content for name in names))


def _all_texts(files: Mapping[str, StaticFile]) -> dict[str, StaticFile]:
    """Two documents a language: the first view's catalogues, and the others."""
    documents: dict[str, StaticFile] = {}
    for language in LANGUAGES:
        catalogues = _catalogues(files, language)
        first = {name: catalogues.pop(name) for name in FIRST_TEXTS if name in catalogues}
        documents |= {
            f"texts/{language}.json": _json(first),
            f"texts/{language}.rest.json": _json(catalogues),
        }
    return documents


def _catalogues(files: Mapping[str, StaticFile], language: str) -> dict[str, Any]:
    """All text catalogues of a language: their names first, then keys."""
    folder = f"texts/{language}/"
    names = _below(files, folder, ".json")
    return {name[len(folder) : -len(".json")]: json.loads(files[name].content) for name in names}


def _json(document: Mapping[str, Any]) -> StaticFile:
    text = json.dumps(document, ensure_ascii=False, separators=(",", ":"))
    return StaticFile(MEDIA_TYPES[".json"], text.encode())


def _below(names: Iterable[str], folder: str, ending: str) -> list[str]:
    return sorted(name for name in names if name.startswith(folder) and name.endswith(ending))


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
