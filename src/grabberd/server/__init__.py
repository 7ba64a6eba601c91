"""The daemon as a whole: its parts put together, its HTTP interface and its page."""
