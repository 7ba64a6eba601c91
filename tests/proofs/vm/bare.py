"""`python -m proofs.vm.bare KIND FAULTS [RELEASE]`: what a driver makes of a device, without grabberd.

FAULTS is JSON, as `Emulated.script` takes them.
"""

import json
import sys

from proofs.vm.guest import bare, shell
from proofs.vm.image import RELEASES, cached_image
from proofs.vm.machine import Machine, counted


def main(kind: str, faults: str, release: str = RELEASES[0]) -> None:
    """Prints the kernel's version and a line for each buffer round the faults."""
    with Machine(cached_image(), counted(0), release=release) as machine:
        print("kernel", machine.call(shell.run, command="uname -rv").strip())
        for line in machine.call(bare.seen, kind=kind, faults=json.loads(faults)):
            print(line)


if __name__ == "__main__":
    main(*sys.argv[1:])
