"""Jobs: long work, one job after the other in a niced process of its own, never in a thread of the daemon.

`job_queue` keeps them, on the disk as in memory; `runner` runs them in the process of `job_process`. Each
file that is named by a kind of job is one job from its declaration, a `JobSpec`, to its result; what it does
with a capture file is a function of its own, which the command line calls as well.
"""
