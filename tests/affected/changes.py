"""The files that differ from a base: committed since, uncommitted, and untracked."""

import subprocess
from pathlib import Path

MAIN = ("origin/main", "main")


def changed_files(root: Path, base: str | None) -> frozenset[Path]:
    """Paths relative to the root; deleted files and the old names of moved ones are among them.

    Raises:
        subprocess.CalledProcessError: The base is no commit.
    """
    against = _git(root, "diff", "--name-only", "--no-renames", "-z", base or default_base(root))
    untracked = _git(root, "ls-files", "--others", "--exclude-standard", "-z")
    return frozenset(Path(name) for name in (against + untracked).split("\0") if name)


def default_base(root: Path) -> str:
    """Where the branch left main; on main itself, and without one, the last commit."""
    for main in MAIN:
        found = subprocess.run(
            ["git", "merge-base", main, "HEAD"], cwd=root, capture_output=True, text=True, check=False
        )
        if found.returncode == 0:
            return found.stdout.strip()
    return "HEAD"


def _git(root: Path, *command: str) -> str:
    return subprocess.run(["git", *command], cwd=root, capture_output=True, text=True, check=True).stdout
