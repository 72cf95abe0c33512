"""Save and restore the state of the service: snapshots between turns, written by a thread of its own."""
