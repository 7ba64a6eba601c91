"""Emulated USB grabbers and cameras, which the guest's own drivers take for real ones.

They attach to the kernel's `vhci_hcd` over USB/IP: dummy_hcd and usbip-vudc refuse isochronous transfers.
"""
