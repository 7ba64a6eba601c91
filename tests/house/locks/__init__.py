"""Locks: what programs and files see of this build, kept as data that later commits compare themselves with.

`python -m tests.house.locks` says what differs; with `--write`, all kept data are made anew. They were made
once, before the source tree was put into another order, and are not made again with it: a lock that a change
breaks on purpose is changed by hand, and the commit says why.
"""
