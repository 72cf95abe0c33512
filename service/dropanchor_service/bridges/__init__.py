"""Poses and samples in the formats of other systems. Pure: no sockets."""
