"""Work outside of the daemon's own process: jobs, their queue, and processes that answer questions."""
