"""How long a test waits for what must happen, in s.

Ample for a busy machine: a wait ends when its condition is met, and only a broken feature makes it last so long.
"""

import inspect

import httpx

PATIENCE_S = 180.0


def be_patient_with_http() -> None:
    """Give this time to all clients of httpx in this process that set no other. Its own default is 5 s."""
    default = inspect.signature(httpx.Client).parameters["timeout"].default
    assert isinstance(default, httpx.Timeout)  # all clients and functions share it
    default.connect = default.read = default.write = default.pool = PATIENCE_S
