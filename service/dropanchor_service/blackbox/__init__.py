"""The black box: what all tags sent in the last hours, with checkpoints, so that any moment can be run again."""
