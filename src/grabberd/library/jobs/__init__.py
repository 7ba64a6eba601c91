"""Jobs on captures: calibrate, check, identify, measure, propose an object.

Each file that is named by a kind of job is one job from its declaration, a `JobSpec` of `work`, to its
result; what it does with a capture file is a function of its own, which the command line calls as well.
"""
