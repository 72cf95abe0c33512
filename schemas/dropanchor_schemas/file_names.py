"""File names of ids, made in one place. This module needs only the standard library, because tags import it."""

from dropanchor_schemas.keys import InvalidKeyError, chunk_from_id
from dropanchor_schemas.sentences import say

MAX_FILE_NAME = 200
"""Characters. File systems allow 255 bytes; the rest is for a time, an ending, and what writers append."""

# Names of devices, whatever follows the first dot. Microsoft, "Naming Files, Paths, and Namespaces".
_DEVICES = {"CON", "PRN", "AUX", "NUL", *(f"{port}{digit}" for port in ("COM", "LPT") for digit in range(10))}


def file_name_of(identifier: str) -> str:
    """Return the name of the file or folder of a site or tag: the chunk that the id has in keys.

    It is one name below its folder, on every system. Raises InvalidKeyError if the id is none, or makes no such name.
    """
    name = chunk_from_id(identifier)
    if len(name) > MAX_FILE_NAME:
        raise InvalidKeyError(
            say(
                "file_long",
                "{id} is too long for the name of a file: escaped, it has {n} bytes",
                id=repr(identifier),
                n=len(name),
            )
        )
    if name.partition(".")[0].upper() in _DEVICES:
        raise InvalidKeyError(
            say(
                "file_device",
                "{id} cannot name a file: on Windows it is a device. Choose another name",
                id=repr(identifier),
            )
        )
    if name.endswith("."):
        raise InvalidKeyError(
            say("file_dot", "{id} cannot name a file: on Windows the dot at its end is lost", id=repr(identifier))
        )
    return name
