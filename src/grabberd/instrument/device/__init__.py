"""One grabber: its capture thread, field pipeline, ring, threshold, recovery, status and worker.

The path of a field: `capture_thread` dequeues it, `field_pipeline` numbers, quantises and packs it and puts
it into the ring, and `worker` measures it from there. Captures belong to a higher layer; the two threads
access them through small protocols.
"""
