"""The paper's processes (its data flow diagrams): pure steps chained over iterables of fields.

No files, no threads, no clocks: the live worker, the command line, the jobs and the archive all call these.
"""
