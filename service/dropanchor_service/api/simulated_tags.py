"""Simulated tags in a process of their own: around one anchor, with raw samples like those of real ones."""

import subprocess
import sys
from collections.abc import Sequence
from threading import Lock
from typing import Self

from dropanchor_schemas.site import Anchor, StartPose, TagSettings
from dropanchor_tag_client.simulator.live import start_poses, tag_name

START_STD_M = 0.1
STOP_TIMEOUT_S = 1.0


def simulated_settings(count: int, seed: int, anchor: Anchor | None = None) -> dict[str, TagSettings]:
    """Return by tag what an operator would know: its start pose and its mounting angle. anchor: None at the origin."""
    x, y = (0.0, 0.0) if anchor is None else (anchor.x, anchor.y)
    return {
        tag_name(index): TagSettings(
            start=StartPose(x=x + start.x, y=y + start.y, heading_rad=start.heading_rad, std_m=START_STD_M),
            mount_angle_rad=0.0,
        )
        for index, start in enumerate(start_poses(count, seed))
    }


class SimulatedTags:
    """Runs `dropanchor-tag` while this context is open, at most once. Its input ends with this process."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._process: subprocess.Popen[bytes] | None = None

    def start(self, arguments: Sequence[str]) -> None:
        """Start the tags, in place of those that run. arguments: of `dropanchor-tag`."""
        command = [sys.executable, "-m", "dropanchor_tag_client", *arguments]
        with self._lock:
            self._end()
            self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.DEVNULL)

    def poll(self) -> int | None:
        """Return the exit code, None while they run or none were started."""
        return None if self._process is None else self._process.poll()

    def stop(self) -> bool:
        """Stop the tags. Return whether any ran."""
        with self._lock:
            return self._end()

    def _end(self) -> bool:
        process, self._process = self._process, None
        if process is None:
            return False
        process.terminate()
        try:
            process.communicate(timeout=STOP_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
        return True

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()
