"""One grabber: its capture thread, field pipeline, ring, threshold, recovery, status and worker.

A field's way: `capture_thread` dequeues it, `field_pipeline` numbers, quantises and packs it and puts it into
the ring, and `worker` measures it from there. Captures stand above this floor; the two threads see them
through small protocols.
"""
