"""Response formats other than JSON."""
