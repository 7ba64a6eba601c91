"""Statements in a process of their own, as another program would run them."""

import subprocess
import sys

ANOTHER = """
import sqlite3, sys
connection = sqlite3.connect(sys.argv[1], timeout=0)
try:
    print(connection.execute(sys.argv[2]).fetchall())
except sqlite3.OperationalError as error:
    print(error)
"""
LOCKED = "database is locked"
COUNT, CHANGE, COMMIT = "SELECT count(*) FROM fields", "BEGIN IMMEDIATE", "BEGIN EXCLUSIVE"
"""What takes the lock of a reader, of a writer, and of one that commits."""


def another_process(path, statement):
    """Answer to a statement, or the error."""
    command = [sys.executable, "-c", ANOTHER, str(path), statement]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
