"""What a restarted service needs to go on: taken between turns, written by a thread of its own."""
