"""`make fuzz`: hostile files, requests and arrays for some minutes; findings go to the corpus."""

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from random import Random

from proofs.fuzz import corpus, hostile_arrays
from proofs.fuzz.samples import make_samples
from proofs.fuzz.targets import COMMANDS, TARGETS

HANG_S = 120
"""Time after which a process that says nothing hangs; on a busy computer reading one file takes seconds."""
FILES_AT_ONCE = 150
COMMANDS_AT_ONCE = 25
REQUESTS = "requests"
ARRAYS = "arrays"


def main() -> int:
    """Returns 1 if anything was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=None, help="default: another one each time")
    parser.add_argument("--only", nargs="*", default=[*TARGETS, REQUESTS, ARRAYS])
    options = parser.parse_args()
    seed = int(time.time()) if options.seed is None else options.seed
    print(f"seed {seed}", flush=True)
    until_s = time.monotonic() + 60 * options.minutes
    random, found = Random(seed), 0
    with tempfile.TemporaryDirectory(prefix="fuzz-") as folder:
        samples = make_samples(Path(folder, "samples"))
        while time.monotonic() < until_s:
            for name in options.only:
                found += _round(samples, name, random.randrange(1 << 31))
                if time.monotonic() > until_s:
                    break
    print(f"{found} findings")
    return int(found > 0)


def _round(samples: Path, name: str, seed: int) -> int:
    file = samples.with_name(
        f"{name}.grab"
    )  # whatever it is: some commands look for captures by their ending
    count = COMMANDS_AT_ONCE if name in COMMANDS else FILES_AT_ONCE
    words = [sys.executable, "-m", "proofs.fuzz.child", str(samples), name, str(seed), str(count), str(file)]
    if name == REQUESTS:
        words = [sys.executable, "-m", "proofs.fuzz.http_requests", str(samples), str(seed)]
    begin_s = time.monotonic()
    if name == ARRAYS:
        code, said = hostile_arrays.run(samples.with_name("kernel"), seed)
    else:
        code, said = _watched(words)
    print(
        f"{name:18} seed {seed:10} {time.monotonic() - begin_s:6.1f} s {'ok' if not code else 'FOUND'}",
        flush=True,
    )
    if code:
        print(said[-3000:], flush=True)
        if name in TARGETS:
            _keep(name, file.with_suffix(".kept"))
    return int(code != 0)


def _watched(words: list[str]) -> tuple[int, str]:
    try:
        done = subprocess.run(
            words, capture_output=True, text=True, errors="replace", timeout=HANG_S * 5, check=False
        )
    except subprocess.TimeoutExpired as error:
        return 1, f"it hangs: {error}"
    return done.returncode, done.stderr


def _keep(name: str, file: Path) -> None:
    kept = corpus.keep(name, file.read_bytes()) if file.exists() else None
    print("it is not kept: the seed makes it again" if kept is None else f"kept: {kept}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
