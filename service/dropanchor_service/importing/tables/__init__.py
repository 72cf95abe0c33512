"""Tables of readings: text with columns, JSON, and the messages of a topic."""
