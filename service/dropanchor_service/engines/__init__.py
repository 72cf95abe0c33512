"""Choosing an engine and compiling it before it is needed."""
