"""The running instrument: threads, clocks and files round the pure rooms.

An `Instrument` owns one grabber: a capture thread that alone touches the device, the ring, a worker that
measures, and at most one recording with its recorder and writer. The `Service` holds all instruments, the
archive of captures and the job process. Nothing here is module state, so a process may hold as many as it
likes.

Floors, the lowest first: `faults` (of the daemon itself), `device` (threads and ring of one grabber),
`capture` (from request to sealed file), `archive` and `calibrations`, then `jobs`, `reprocess`, `live` and
`mqtt`. import-linter holds their order.
"""
