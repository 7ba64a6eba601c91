"""Work outside of the daemon's own process: jobs, their queue, and processes that answer questions.

Jobs are long work, one after the other in a niced process of its own, never in a thread of the daemon.
`job_queue` keeps them, on the disk as in memory; `runner` runs them in the process of `job_process`. What a
job does is not known here: each is a `JobSpec`, declared in a room above.
"""
