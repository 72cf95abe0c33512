"""Patterns: what a module prints, as data. tag_client/docs/patterns.md describes how to write one."""
