"""Changes are found in a repository of their own."""

import subprocess
from pathlib import Path

import pytest
from tests.affected.changes import changed_files, default_base


@pytest.fixture
def root(tmp_path: Path) -> Path:
    git(tmp_path, "init", "--quiet", "--initial-branch", "main")
    commit(tmp_path, "kept.py", "moved.py")
    return tmp_path


def git(root: Path, *command: str) -> None:
    who = ("-c", "user.name=tester", "-c", "user.email=tester@example.org", "-c", "commit.gpgsign=false")
    subprocess.run(["git", *who, *command], cwd=root, check=True, capture_output=True)


def commit(root: Path, *names: str) -> None:
    for name in names:
        (root / name).write_text(name)
    git(root, "add", "--all")
    git(root, "commit", "--quiet", "--message", "Change")


def test_commits_of_the_branch_uncommitted_and_untracked_files_count(root: Path) -> None:
    git(root, "checkout", "--quiet", "-b", "branch")
    commit(root, "committed.py")
    git(root, "mv", "moved.py", "renamed.py")
    (root / "committed.py").write_text("again")
    (root / "new file.py").write_text("new")
    expected = {"committed.py", "moved.py", "renamed.py", "new file.py"}
    assert changed_files(root, None) == {Path(name) for name in expected}


def test_what_main_got_meanwhile_is_no_change_of_the_branch(root: Path) -> None:
    git(root, "checkout", "--quiet", "-b", "branch")
    git(root, "checkout", "--quiet", "main")
    commit(root, "of_main.py")
    git(root, "checkout", "--quiet", "branch")
    assert changed_files(root, None) == frozenset()


def test_without_main_the_last_commit_is_the_base(root: Path) -> None:
    git(root, "branch", "--move", "trunk")
    assert default_base(root) == "HEAD"


def test_a_base_that_is_no_commit_is_an_error(root: Path) -> None:
    with pytest.raises(subprocess.CalledProcessError):
        changed_files(root, "nowhere")
