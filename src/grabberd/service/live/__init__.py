"""What the daemon shows of this moment: devices, newest points, preview, changes of state."""
