"""The tracks of all tags, stored on disk."""
