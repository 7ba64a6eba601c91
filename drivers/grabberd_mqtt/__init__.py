"""Publishes the devices' states and the summaries of captures to an MQTT broker.

It subscribes to nothing, so that whoever owns the broker cannot command an instrument.
"""
