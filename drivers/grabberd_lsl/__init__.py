"""Points and events of a running daemon for the Lab Streaming Layer, by a program beside the daemon."""
