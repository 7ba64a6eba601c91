"""Responses that go on: server-sent events, preview, downloads.

A feed is made once for all its listeners and queues nothing for any of them, so a slow client costs neither
memory nor the capture. Downloads are made while they are sent.
"""
