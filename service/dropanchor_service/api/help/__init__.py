"""The documentation as pages of the service: rendered from its Markdown, without scripts and without a network."""
