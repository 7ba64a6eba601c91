"""Long-lived responses: server-sent events, preview, downloads.

A feed makes each message once for all its listeners and queues nothing, so a slow client costs no memory and
cannot disturb a capture. Downloads are generated while they are sent.
"""
