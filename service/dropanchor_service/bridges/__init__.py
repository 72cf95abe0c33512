"""Poses of a running service in the formats of other systems. Pure: no sockets."""
