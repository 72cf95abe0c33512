"""Make a release: its version, its files, and what is said of them. README.md is for the people who do it."""
