"""Start Ray on one machine, with the settings that a cluster needs."""

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

LONGEST_FOLDER = 40  # bytes of its path: Ray adds 66 for its sockets, which may have 107
OBJECT_STORE_BYTES = 80_000_000  # the least; shards keep nothing there
STOP_S = 5.0  # its buckets have moved by then
_SETTINGS = {
    "RAY_USAGE_STATS_ENABLED": "0",
    "RAY_AUTH_MODE": "token",
    "RAY_health_check_period_ms": "500",
    "RAY_health_check_timeout_ms": "1000",
    "RAY_health_check_failure_threshold": "3",
    "RAY_health_check_initial_delay_ms": "1000",
    "RAY_raylet_liveness_self_check_interval_ms": "1000",
    "RAY_gcs_rpc_server_reconnect_timeout_s": "3600",  # nodes wait so long for the head, and exit then
    "RAY_worker_niceness": "0",
    "RAY_memory_monitor_refresh_ms": "0",  # a full machine is for the kernel to judge
}


def require_ray() -> None:
    """Raise ModuleNotFoundError without the extra `cluster`. Ray itself is imported once its settings are made."""
    if find_spec("ray") is None:
        raise ModuleNotFoundError("No module named 'ray'", name="ray")


def ray_settings(token: Path) -> dict[str, str]:
    """Return the variables that Ray reads, also in a process that connects to it. token: its file."""
    return _SETTINGS | {"RAY_AUTH_TOKEN_PATH": str(token)}


@dataclass(frozen=True)
class RayNode:
    """Ray on this machine.

    name: of the node. folder: for the state of the head, sockets and logs. address: of this machine. head: address and
    port of the head to join, "" for the one in the database; None to be the head. port: of the head. shards: how many
    this machine carries.
    """

    name: str
    folder: Path
    address: str
    head: str | None
    port: int
    shards: int

    def command(self, at: str) -> list[str]:
        """Return the command that runs Ray until it is told to stop. at: address and port of the head."""
        as_head = ["--head", "--port", str(self.port), "--include-dashboard=false"]
        role = as_head if self.head is None else ["--address", at]
        options = {
            "--node-name": self.name,
            "--num-cpus": "0",
            "--resources": json.dumps({"shard": self.shards}),
            "--object-store-memory": str(OBJECT_STORE_BYTES),
            "--temp-dir": str(self.folder / "ray"),
            "--include-log-monitor": "false",
            "--min-worker-port": "0",  # any that are free: Ray's own choice may be those of others
            "--max-worker-port": "0",
            "--node-ip-address": self.address,
        }
        words = [word for pair in options.items() for word in pair]
        return [sys.executable, "-m", "ray.scripts.scripts", "start", "--block", "--disable-usage-stats", *role, *words]

    def started(self, at: str, environment: Mapping[str, str]) -> "subprocess.Popen[bytes]":
        """Start Ray. at: address and port of the head. Its messages go to a file beside its logs."""
        kept = {"RAY_gcs_storage": "rocksdb", "RAY_gcs_storage_path": f"{self.folder}/gcs"}
        storage = kept if self.head is None else {}
        for name in ("ray", "gcs"):
            (self.folder / name).mkdir(parents=True, exist_ok=True)
        # It names the head that ran last. With a process of Ray beside it, Ray would take that head for a running one.
        (self.folder / "ray" / "ray_current_cluster").unlink(missing_ok=True)
        with (self.folder / "ray.log").open("wb") as log:
            return subprocess.Popen(
                self.command(at),
                env={**environment, **storage},
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,  # Ctrl-C is for us: we stop Ray after its buckets have moved
            )

    def last_words(self) -> str:
        """Return the last line of its messages."""
        lines = (self.folder / "ray.log").read_text(errors="replace").splitlines()
        return next((line.strip() for line in reversed(lines) if line.strip()), "it said nothing")


def stop_ray(process: "subprocess.Popen[bytes]") -> None:
    """Ask Ray to stop, and end it if it does not."""
    process.terminate()
    try:
        process.wait(STOP_S)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, 9)
        process.wait()
