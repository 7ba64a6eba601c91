"""Runs the cells of a notebook from first to last, and keeps its pictures; what it says goes to the terminal.

usage: notebook.py NOTEBOOK.ipynb [FOLDER]
"""

import json
import sys
from pathlib import Path
from typing import Any


def main(notebook: Path, folder: Path) -> None:
    """In one namespace, as Jupyter does; pictures as PNG in the folder."""
    names: dict[str, Any] = {"__name__": "__main__"}
    for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), cell["id"], "exec"), names)
    plt = names["plt"]
    for number in plt.get_fignums():
        plt.figure(number).savefig(folder / f"{notebook.stem}-{number}.png", dpi=80)
    print(f"{notebook.name}: ran to its end, {len(plt.get_fignums())} pictures")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2] if len(sys.argv) > 2 else "."))
