"""Decode messages of ROS by the definitions that the file holds."""

from collections.abc import Callable
from typing import Any

from rosbags.serde import SerdeError
from rosbags.typesys import Stores, TypesysError, get_types_from_idl, get_types_from_msg, get_typestore

from dropanchor_service.importing.bags.bag import normal

_IDL_MARK = "=" * 80 + "\nIDL: "


def decoder(name: str, form: str, text: bytes, encoding: str) -> tuple[Callable[[bytes], Any] | None, str]:
    """Return what decodes messages of a type, or None and why nothing does.

    form: of the definition `text`, ros1msg, ros2msg or ros2idl. encoding: of the messages, ros1 or cdr.
    """
    store, known = get_typestore(Stores.EMPTY), normal(name)
    try:
        definition = text.decode()
        if form == "ros2idl":
            for part in definition.split(_IDL_MARK):
                store.register(get_types_from_idl(part.partition("\n")[2] if _IDL_MARK in definition else part))
        else:
            store.register(get_types_from_msg(definition, known))
    except (TypesysError, UnicodeDecodeError, ValueError) as error:
        return None, f"its definition cannot be read: {error}"
    read = store.deserialize_ros1 if encoding == "ros1" else store.deserialize_cdr

    def decode(data: bytes) -> Any:
        try:
            return read(data, known)
        except (SerdeError, KeyError) as error:
            raise ValueError(str(error)) from error

    return decode, ""
