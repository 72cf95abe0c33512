"""A light client that publishes the raw range and IMU samples of a tag."""

from dropanchor_tag_client.calibration import Calibration, read_calibration
from dropanchor_tag_client.client import TagClient
from dropanchor_tag_client.credentials import Credentials, read_credentials
from dropanchor_tag_client.session import ConnectError, SessionSettings
from dropanchor_tag_client.upkeep import Upkeep

__all__ = [
    "Calibration",
    "ConnectError",
    "Credentials",
    "SessionSettings",
    "TagClient",
    "Upkeep",
    "read_calibration",
    "read_credentials",
]
