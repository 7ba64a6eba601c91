"""`python -m tests.proofs.bench.peers [--fields N] [--turns N] [--write | --page]`; else it only prints."""

import argparse
import os

from tests.proofs.bench.peers.compared import run
from tests.proofs.bench.peers.history import PAGE, RUNS, keep, kept
from tests.proofs.bench.peers.rendering import page


def main() -> None:
    """Measures and prints; keeps the run where that is asked for."""
    parser = argparse.ArgumentParser(prog="python -m tests.proofs.bench.peers", description=__doc__)
    parser.add_argument("--fields", type=int, default=40)
    parser.add_argument("--turns", type=int, default=21)
    parser.add_argument("--write", action="store_true", help="keep the run in docs/benchmarks")
    parser.add_argument("--page", action="store_true", help="only make the page anew, from the runs kept")
    options = parser.parse_args()
    if options.page:
        PAGE.write_text(page(kept(RUNS)))
        return
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})  # the peers' process inherits it
    done = run(options.fields, options.turns)
    print(page([done]))
    if options.write:
        print(f"\nkept as {keep(done)}")


if __name__ == "__main__":
    main()
