"""Lists in settings that an environment variable can hold, too."""


def as_list(value: object) -> object:
    """Split text at commas, and return anything else as it is."""
    return [part.strip() for part in value.split(",") if part.strip()] if isinstance(value, str) else value
