"""The publisher that tells an MQTT broker how the devices are and what has been captured.

It subscribes to nothing, so nothing can be commanded through the broker.
"""
