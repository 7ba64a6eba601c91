"""Heavy reads: requests that read captures take no thread that short requests need, and each has an end.

What reads the fields of a capture does so in a process of its own.
"""
