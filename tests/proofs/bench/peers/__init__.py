"""The work beside that of other programs: same fields, same truth, one thread each, by turns.

`given`, `ours`, `run` and their like work in the project's environment; `theirs` and `optv_ways` in that of
the peers, where nothing of the project is installed.
"""
