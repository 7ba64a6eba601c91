"""What the fuzz has found stays fixed, and the fuzz itself does what it says."""

from pathlib import Path
from random import Random

import pytest

from archive.captures import slots, write
from grabberd.core.kernel import KERNEL
from proofs.fuzz import hostile_arrays
from proofs.fuzz.child import DEADLINE_S
from proofs.fuzz.corpus import content_of, kept
from proofs.fuzz.mutation import change_cells, changed
from proofs.fuzz.samples import make_small
from proofs.fuzz.targets import TARGETS, attempt


@pytest.fixture(scope="module")
def samples(tmp_path_factory):
    return make_small(tmp_path_factory.mktemp("samples"))


@pytest.mark.timeout(4 * DEADLINE_S)
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(("target", "path"), list(kept()), ids=lambda value: Path(value).name)
def test_a_file_that_was_read_wrongly_is_refused_or_read(samples, target, path):
    file = samples / TARGETS[target].kind / path.name
    file.write_bytes(content_of(path))
    attempt(TARGETS[target], file)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    "target", ["calibration", "object", "config", "truth", "marks", "vacuum", "png", "manifest"]
)
def test_a_few_files_of_every_small_kind_are_refused_or_read(samples, target):
    random = Random(target)
    files = [path.read_bytes() for path in sorted((samples / TARGETS[target].kind).iterdir())]
    file = samples / TARGETS[target].kind / "hostile"
    for _ in range(10):
        file.write_bytes(changed(random, random.choice(files), files))
        attempt(TARGETS[target], file)
    file.unlink()


def test_a_few_captures_are_refused_or_read(tmp_path):
    random = Random(1)
    for number in range(20):
        folder = tmp_path / str(number)
        folder.mkdir()
        path = write(folder, slots(3), measured=[0, 1])
        change_cells(random, path)
        for target in ("capture", "index", "replay", "seal"):
            attempt(TARGETS[target], path)


def test_the_same_seed_makes_the_same_file():
    assert changed(Random(7), b"a: 1", [b"b: 2"]) == changed(Random(7), b"a: 1", [b"b: 2"])


def test_an_error_that_is_no_refusal_is_a_finding(tmp_path):
    broken = TARGETS["truth"]._replace(read=lambda path, folder: path / 1)
    with pytest.raises(TypeError):
        attempt(broken, tmp_path)


@pytest.mark.skipif(not KERNEL, reason="there is no compiled kernel here")
def test_the_kernel_refuses_or_measures_hostile_arrays():
    random = Random(5)
    for _ in range(300):
        hostile_arrays.call(random, KERNEL)
