"""Solves the walls of all cases and writes their tables: `python -m tools.liner_wall FOLDER [CASE …]`."""

import sys
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

from tools.liner_wall.designs import Case, cases, mounted
from tools.liner_wall.equilibrium import NoEquilibrium
from tools.liner_wall.path import follow
from tools.liner_wall.table import save_table

FROM_MPA, TO_MPA, STEP_MPA = -0.003, 0.050, 0.003


def main(arguments: list[str]) -> int:
    """Solves the named cases, or all, each in a process."""
    known = {case.name: case for case in cases()}
    if not arguments or set(arguments[1:]) - set(known):
        print("usage: python -m tools.liner_wall FOLDER [CASE …]", file=sys.stderr)
        print(f"cases: {', '.join(known)}", file=sys.stderr)
        return 2
    folder = Path(arguments[0])
    folder.mkdir(parents=True, exist_ok=True)
    chosen = [known[name] for name in arguments[1:]] or list(known.values())
    failed = False
    with ProcessPoolExecutor() as pool:
        waiting = {pool.submit(solve_case, case, folder): case for case in chosen}
        for done in as_completed(waiting):
            try:
                print(done.result(), flush=True)
            except (NoEquilibrium, OverflowError) as error:
                failed = True
                print(f"{waiting[done].name}: {error}", file=sys.stderr, flush=True)
    return int(failed)


def solve_case(case: Case, folder: Path) -> str:
    """Solves one case; returns a line about it."""
    began_s = time.process_time()
    tube, state = mounted(case.design, case.fineness, case.sector)
    push = case.push(tube.mesh.inner_angles())
    rests = list(follow(tube, state, FROM_MPA, TO_MPA, STEP_MPA, push))
    path = folder / f"{case.name}.npz"
    save_table(path, case, tube, rests)
    spent_s, size_kb = time.process_time() - began_s, path.stat().st_size / 1000
    snaps = sum(rest.snapped for rest in rests)
    return f"{case.name}: {len(rests)} states, {snaps} snaps, {size_kb:.0f} kB, {spent_s:.0f} s"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
