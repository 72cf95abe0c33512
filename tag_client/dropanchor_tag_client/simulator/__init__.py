"""Simulated tags: scenarios, sensors, perturbations. Needs numpy (the extra `simulator`); the rest does not."""
