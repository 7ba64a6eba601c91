"""Jobs: long work, one job after the other in a niced process of its own, never in a thread of the daemon.

`runner` queues and runs them. Each of the other files is one job from its declaration, a `JobSpec`, to its
result; what it does with a capture file is a function of its own, which the command line calls as well.
"""
