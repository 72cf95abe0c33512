"""Simulated tags: scenarios, sensors and perturbations. Only this package needs numpy (the extra `simulator`)."""
