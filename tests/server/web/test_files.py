"""The page's files: one version for all, compressed once, read again when they change."""

import gzip
import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from grabberd.server.web import Files
from grabberd.server.web.page import COMMENTS, STATIC, render

EDITION = Files().newest()
MOST_BYTES = 400_000
FIRST_BYTES = 80_000
LIBRARIES = STATIC / "vendor"


def small(folder: Path) -> Path:
    (folder / "css").mkdir()
    (folder / "texts" / "en").mkdir(parents=True)
    (folder / "css" / "a.css").write_text("a {}")
    (folder / "css" / "b.css").write_text("b {}")
    (folder / "texts" / "en" / "core.json").write_text('{"skip": "Skip"}')
    (folder / "texts" / "en" / "replay.json").write_text('{"loop": "Loop"}')
    return folder


def test_the_whole_page_is_lighter_than_a_photograph() -> None:
    served = [file for name, file in EDITION.files.items() if not name.endswith("LICENSE.txt")]
    assert sum(len(file.compressed) for file in served) <= MOST_BYTES


@pytest.mark.parametrize("language", ["en", "nb"])
def test_the_first_view_is_light(language: str) -> None:
    page = re.findall(rf'/static/{EDITION.version}/([\w./]+)"', render(EDITION, language, {}))
    assert sum(len(EDITION.files[name].compressed) for name in {*page, "symbols.svg"}) <= FIRST_BYTES


def test_what_is_compressed_is_the_same() -> None:
    assert all(gzip.decompress(file.compressed) == file.content for file in EDITION.files.values())


def test_the_version_changes_with_any_file(tmp_path: Path) -> None:
    files = Files(small(tmp_path))
    before = files.newest()
    assert files.newest() is before
    (tmp_path / "css" / "a.css").write_text("a { color: red }")
    assert files.newest().version != before.version


def test_style_sheets_are_served_as_one_and_catalogues_as_the_first_view_s_and_the_others(
    tmp_path: Path,
) -> None:
    edition = Files(small(tmp_path)).newest()
    assert edition.files["page.css"].content == b"a {}\nb {}"
    assert json.loads(edition.files["texts/en.json"].content) == {"core": {"skip": "Skip"}}
    assert json.loads(edition.files["texts/en.rest.json"].content) == {"replay": {"loop": "Loop"}}
    languages = {f"texts/{language}{part}.json" for language in ("en", "nb") for part in ("", ".rest")}
    assert set(edition.files) == {"page.css"} | languages


def test_modules_are_served_without_comments_and_with_their_line_numbers(tmp_path: Path) -> None:
    (tmp_path / "js").mkdir()
    comments = "// Why.\n/**\n * @param {number} n\n */\n"
    module = comments + 'const home = "http://a"; // stays\n  /** @type {1} */ let n = 1;\n'
    (tmp_path / "js" / "a.js").write_text(module)
    served = Files(small(tmp_path)).newest().files["js/a.js"].content.decode()
    assert served == '\n\n\n\nconst home = "http://a"; // stays\n let n = 1;\n'


def test_nothing_is_taken_for_a_comment_inside_a_text_of_several_lines() -> None:
    for path in (STATIC / "js").rglob("*.js"):
        module = path.read_bytes()
        for comment in COMMENTS.finditer(module):
            before = COMMENTS.sub(b"", module[: comment.start()])
            assert before.count(b"`") % 2 == 0, f"{path.name}: {comment[0].decode()}"


def test_the_order_of_the_layers_is_said_before_any_of_them_begins() -> None:
    own = EDITION.files["page.css"].content.decode()
    assert own.index("@layer tokens, base, components, shell, panels;") < own.index("@layer panels {")


def test_every_library_comes_with_its_licence() -> None:
    for library in (one for one in LIBRARIES.glob("*") if one.is_dir()):
        assert list(library.glob("LICENSE*")), library.name


def test_every_symbol_that_is_named_is_in_the_sprite() -> None:
    known = set(re.findall(r'<symbol id="([\w-]+)"', (STATIC / "symbols.svg").read_text()))
    named = {
        name
        for path in (STATIC / "js").rglob("*.js")
        for name in re.findall(r'symbol\("([\w-]+)"', path.read_text())
    }
    assert named <= known


@pytest.mark.skipif(shutil.which("node") is None, reason="node is missing: sudo apt-get install nodejs")
def test_every_module_can_be_read() -> None:
    modules = [path for path in sorted((STATIC / "js").rglob("*.js")) if path.name != "choices.js"]
    checking = "import { SourceTextModule } from 'node:vm'; import { readFileSync } from 'node:fs';" + (
        "for (const path of process.argv.slice(1))"
        " new SourceTextModule(readFileSync(path, 'utf8'), { identifier: path });"
    )
    command = ["node", "--no-warnings", "--experimental-vm-modules", "--input-type=module", "-e", checking]
    done = subprocess.run([*command, *map(str, modules)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_no_module_is_long() -> None:
    long = {
        path.name: lines
        for path in (STATIC / "js").rglob("*.js")
        if (lines := len(path.read_text().splitlines())) > 200
    }
    assert long == {}
