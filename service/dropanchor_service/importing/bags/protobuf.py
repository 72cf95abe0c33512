"""Decode messages of protobuf by the descriptors that the file holds, if the package is installed."""

from collections.abc import Callable
from typing import Any


def decoder(name: str, descriptors: bytes) -> tuple[Callable[[bytes], Any] | None, str]:
    """Return what decodes messages of a type, or None and why nothing does. descriptors: a FileDescriptorSet."""
    try:
        from google.protobuf import descriptor_pb2, descriptor_pool, json_format, message, message_factory
    except ModuleNotFoundError:
        return None, "protobuf: pip install protobuf"
    try:
        files = descriptor_pb2.FileDescriptorSet.FromString(descriptors)
        pool = descriptor_pool.DescriptorPool()
        for file in files.file:
            pool.Add(file)
        kind = message_factory.GetMessageClass(pool.FindMessageTypeByName(name))
    except (message.DecodeError, KeyError, TypeError) as error:
        return None, f"its descriptors cannot be read: {error}"

    def decode(data: bytes) -> Any:
        try:
            return json_format.MessageToDict(
                kind.FromString(data), preserving_proto_field_name=True, always_print_fields_with_no_presence=True
            )
        except message.DecodeError as error:
            raise ValueError(str(error)) from error

    return decode, ""
