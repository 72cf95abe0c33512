"""What may be wrong with the file of a base map. This module needs no extra."""


class UnusableFileError(ValueError):
    """The file cannot be a base map. The message says why."""


class UnreadableTileError(Exception):
    """A tile is damaged, too large, or cannot be read now. The message says which."""
