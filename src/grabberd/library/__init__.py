"""The Python library: captures, calibrations, analyses and running daemons, for notebooks and scripts.

It is what `import grabberd` offers, docs/reference/python.md; all other modules may change with any release.
"""
