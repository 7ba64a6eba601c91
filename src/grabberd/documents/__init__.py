"""The documents that leave the daemon, each typed once: one module per noun.

`archive` and `instrument` build them, the HTTP API and MQTT serialise them, OpenAPI describes them, and the
page's types are generated from that description. Every model is frozen and refuses unknown keys. The bodies
that clients send are here too (`requests`), because both ends use them: the routes read them, and `grabberd
capture` writes them. This room knows only the types of the core and of the configuration.
"""
