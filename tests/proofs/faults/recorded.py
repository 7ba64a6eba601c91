"""The daemon as it is installed, but for its simulated grabbers, whose pictures are drawn once.

python recorded.py serve --config grabberd.yaml
"""

import sys
from pathlib import Path

import grabberd_fake.grabber
from grabberd.cli import main

sys.path.append(str(Path(__file__).parents[2]))

from recorded_world import world_of

if __name__ == "__main__":  # a process of jobs imports this module, too
    grabberd_fake.grabber.World = world_of  # type: ignore[misc]
    grabberd_fake.grabber.DrawnAhead = world_of  # type: ignore[misc]
    main()
