"""The running instrument: grabbers and loggers with their threads, and captures in progress.

An `Instrument` owns one grabber: a capture thread that alone touches the device, the ring, a worker that
measures, and at most one recording with its recorder and writer.

Layers, the lowest first: `acquisition` (from buffers to numbered fields), `device` (threads and ring of one
grabber), `channels` (threads of loggers), `capture` (from request to sealed file) and `live` (documents
and pictures for clients).
"""
