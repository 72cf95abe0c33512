"""From samples to nodes: the attitude, standstill, magnetometer and pre-integration of one tag."""
