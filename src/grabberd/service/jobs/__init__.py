"""Jobs: what takes long runs in one niced process of its own, never in a thread of the daemon."""
