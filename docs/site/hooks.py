"""The site's own pages, as Markdown like the rest: notebooks, files of the root, the list of decisions."""

import json
import re
from os.path import normpath, relpath
from pathlib import Path
from shutil import rmtree
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[2]
LINK = re.compile(r"(!?)\[([^\]]*)\]\(([^)#\s]+)(#[^)\s]*)?\)")
NOTEBOOKS = "notebooks/"
TUTORIALS = "tutorials/"
OF_ROOT = {"README.md": "index.md", "CHANGELOG.md": "changelog.md", "CONTRIBUTING.md": "contributing.md"}
"""Files beside docs/ that are pages of the site, by their addresses there."""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that are no Markdown files below docs/: notebooks, those of the root, and decisions."""
    for path in sorted((ROOT / "docs" / "notebooks").glob("*.ipynb")):
        notebook = path.read_text(encoding="utf-8")
        text = _notebook_page(json.loads(notebook), path.name)
        files.append(File.generated(config, f"{TUTORIALS}{path.stem}.md", content=text))
        files.append(File.generated(config, f"{TUTORIALS}{path.name}", content=notebook))
    for name, uri in OF_ROOT.items():
        text = LINK.sub(_seen_from_docs, (ROOT / name).read_text(encoding="utf-8"))
        files.append(File.generated(config, uri, content=text))
    decisions = sorted((ROOT / "docs" / "decisions").glob("*.md"))
    listing = "".join(f"- [{_title(path)}](decisions/{path.name})\n" for path in decisions)
    files.append(File.generated(config, "decisions.md", content=f"# Decisions\n\n{listing}"))
    return files


def on_post_build(config: MkDocsConfig) -> None:
    """Remove what a daemon has no use for: sources of scripts, stemmers, a map for robots."""
    site = Path(config.site_dir)
    rmtree(site / "assets" / "javascripts" / "lunr")
    for pattern in ("**/*.map", "sitemap.xml*", "404.html", "objects.inv"):
        for path in site.glob(pattern):
            path.unlink()


def on_page_markdown(markdown: str, *, page: Page, files: Files, **_: Any) -> str:
    """Point links at pages of the site, and keep the words alone of links to what only the repository has."""

    def repaired(link: re.Match[str]) -> str:
        image, words, target, anchor = link.groups()
        if "://" in target or target.startswith("mailto:"):
            return link[0]
        if NOTEBOOKS in target:
            target = target.replace(NOTEBOOKS, TUTORIALS).replace(".ipynb", ".md")
        place = normpath(docs / Path(page.file.src_uri).parent / target)
        is_ours = files.get_file_from_path(relpath(place, docs)) is not None
        # One that leads nowhere at all is left as it is: building strictly fails at it.
        return f"{image}[{words}]({target}{anchor or ''})" if is_ours or not Path(place).exists() else words

    docs = ROOT / "docs"
    return LINK.sub(repaired, markdown)


def _seen_from_docs(link: re.Match[str]) -> str:
    """A link of a file beside docs/ as it would be written inside of it."""
    image, words, target, anchor = link.groups()
    if "://" in target or target.startswith("mailto:"):
        return link[0]
    inside = (
        target.removeprefix("docs/") if target.startswith("docs/") else OF_ROOT.get(target, f"../{target}")
    )
    return f"{image}[{words}]({inside}{anchor or ''})"


def _title(path: Path) -> str:
    return path.read_text(encoding="utf-8").splitlines()[0].removeprefix("# ")


def _notebook_page(notebook: dict[str, Any], name: str) -> str:
    parts = []
    for cell in notebook["cells"]:
        text = "".join(cell["source"])
        parts.append(text if cell["cell_type"] == "markdown" else f"```python\n{text}\n```")
    parts.append(f"*This page is the notebook [{name}]({name}), without its pictures: run it to see them.*")
    return "\n\n".join(parts)
