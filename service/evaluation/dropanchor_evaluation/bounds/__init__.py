"""Posterior Cramér-Rao bounds with all that a tag does not know: mounting angle, slip, biases, tilt, hard iron."""
