"""A server on loopback with the API of S3."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from unittest.mock import patch

import httpx
from s3fs import S3FileSystem

from support.zenoh_router import free_port, wait_until

BUCKET = "shared"


@dataclass
class S3:
    """A server. url: of a folder in its only bucket. port: where it listens."""

    process: "subprocess.Popen[bytes]"
    port: int
    url: str = f"s3://{BUCKET}/dropanchor"

    @property
    def environment(self) -> dict[str, str]:
        """What the library of S3 reads."""
        keys = {"AWS_ACCESS_KEY_ID": "test", "AWS_SECRET_ACCESS_KEY": "test", "AWS_DEFAULT_REGION": "us-east-1"}
        return {"AWS_ENDPOINT_URL": f"http://127.0.0.1:{self.port}", **keys}

    def stop(self) -> None:
        self.process.terminate()
        self.process.wait()


@contextmanager
def running_s3() -> Iterator[S3]:
    """Run a server with an empty bucket until the block ends, and let this process use it."""
    port = free_port()
    program = [sys.executable, "-m", "moto.server", "-H", "127.0.0.1", "-p", str(port)]
    server = S3(subprocess.Popen(program, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL), port)
    try:
        with patch.dict(os.environ, server.environment):
            S3FileSystem.clear_instance_cache()  # it would go on with another server
            wait_until(lambda: _put_bucket(port))
            yield server
    finally:
        server.stop()


def _put_bucket(port: int) -> bool:
    try:
        with httpx.Client(trust_env=False, verify=False) as client:
            return client.put(f"http://127.0.0.1:{port}/{BUCKET}").is_success
    except httpx.HTTPError:
        return False
