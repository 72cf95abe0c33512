"""The routes of the omlox interface, one module per resource."""
