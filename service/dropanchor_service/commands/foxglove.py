"""`dropanchor foxglove`: a live WebSocket server for Foxglove and Lichtblick, fed by a running service."""

import argparse
import sys
import time
from collections.abc import Mapping, Sequence
from typing import Any
from urllib.parse import quote

import foxglove
from foxglove.channels import FrameTransformsChannel, LocationFixesChannel, PoseInFrameChannel, SceneUpdateChannel

from dropanchor_schemas.epochs import EpochFence
from dropanchor_schemas.keys import chunk_from_id
from dropanchor_service.bridges.foxglove_scene import is_placed, location_fixes, pose_in_frame, scene, transforms
from dropanchor_service.bridges.frames import in_its_frame
from dropanchor_service.commands.options import positive
from dropanchor_service.commands.rest import KEY_VARIABLE, RefusedError, add_rest_options, asked
from dropanchor_service.runtime.signals import Interrupt, interrupts
from dropanchor_service.zenoh_io.exposure import is_loopback

DESCRIPTION = f"""\
Shows the poses of a running service live in Foxglove or Lichtblick. It asks the service over REST, and serves the
viewers over WebSocket (protocol foxglove.sdk.v1). In the viewer, choose "Open connection", "Foxglove WebSocket" and the
address that this command prints. If the service requires an API key, set the environment variable {KEY_VARIABLE}.
"""
EPILOG = """\
topics:
  /scene                 anchors, tags with heading and state, 95 % ellipses, hypotheses    for the panel 3D
  /tf                    frames site, anchor/ANCHOR and tag/TAG                             to follow a tag in 3D
  /locations             latitude and longitude, on a georeferenced site                    for the panel Map
  /tag/TAG/pose          the pose of a tag                                                  for the panel 3D
  /tag/TAG/estimate      state, reason, speed, accuracy and the rest of a pose              for Plot and Table

While north is unknown, the state is `relative`: the tag is in the frame site/TAG instead of site, and its pose on
/tag/TAG/relative_pose. Choose site/TAG as the display frame to see it.

examples:
  dropanchor foxglove
  dropanchor foxglove forklift-7 forklift-8               only these tags
  dropanchor foxglove --url https://yard.example:8080 --ca security/ca.pem
  dropanchor foxglove --host 0.0.0.0 --insecure           every machine of the network can look
"""
EXIT_ERROR = 2
PORT = 8765
FULL_S = 1.0  # so often everything is sent, changed or not, for viewers that have just connected
SITE_S = 2.0
MAX_TAG_TOPICS = 100  # tags with topics of their own; viewers get slow with thousands

Json = Mapping[str, Any]

_TEXTS = ("state", "reason", "hint", "frame", "anchor")
_NUMBERS = ("x", "y", "heading_rad", "speed_mps", "yaw_rate_radps", "age_s")
_ACCURACIES = ("p_mode", "sigma_pos_m", "sigma_obs_m", "range_m")
_OF_RELATIVE = ("x", "y", "heading_rad", "p_mode", "sigma_pos_m")
ESTIMATE_SCHEMA: dict[str, Any] = {
    "type": "object",
    "title": "dropanchor.Estimate",
    "properties": {name: {"type": "string"} for name in _TEXTS}
    | {name: {"type": "number"} for name in (*_NUMBERS, *_ACCURACIES)}
    | {"t_ns": {"type": "integer"}, "online": {"type": "boolean"}}
    | {"relative_pose": {"type": "object", "properties": {name: {"type": "number"} for name in _OF_RELATIVE}}},
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("tags", metavar="TAG", nargs="*", help="tags to show (default: all)")
    add_rest_options(parser)
    parser.add_argument(
        "--host",
        default="127.0.0.1",
        help="address for the viewers (default: %(default)s); any program or open web page of this machine may connect",
    )
    parser.add_argument("--port", type=int, default=PORT, help="port for the viewers (default: %(default)s); 0: any")
    parser.add_argument("--max-hz", type=positive, default=10, metavar="HZ", help="updates per second (default: 10)")
    parser.add_argument(
        "--insecure", action="store_true", help="listen beyond the loopback: the protocol knows no passwords"
    )


def run(arguments: argparse.Namespace) -> int:
    """Serve viewers until Ctrl-C or SIGTERM. Return 0, or 2 on an error."""
    if not arguments.insecure and not is_loopback(arguments.host):
        _say(f"{arguments.host} would show all poses to the network, without a password. If you want that: --insecure")
        return EXIT_ERROR
    live = LiveScene(arguments)
    try:
        live.refresh_site()
        server = foxglove.start_server(
            name="Dropanchor", host=arguments.host, port=arguments.port, context=live.context
        )
    except RefusedError as error:
        _say(str(error))
        return EXIT_ERROR
    except RuntimeError as error:  # of the SDK
        _say(f"{error}. Choose another address with --host and --port.")
        return EXIT_ERROR
    try:
        with interrupts() as interrupt:
            _say(f"ready at ws://{arguments.host}:{server.port}")
            _follow(live, interrupt, 1 / arguments.max_hz)
    finally:
        server.stop()
    return 0


def _follow(live: "LiveScene", interrupt: Interrupt, period_s: float) -> None:
    """Update the scene until a signal comes. Say once that the service is away, and once that it is back."""
    away = False
    while True:
        began_s = time.monotonic()
        try:
            live.update()
            if away:
                _say("the service answers again")
            away = False
        except RefusedError as error:
            if not away:
                _say(f"{error}. Still trying.")
            away = True
        took_s = time.monotonic() - began_s
        if interrupt.wait_for(max(period_s - took_s, took_s, 1.0 if away else 0.0)):  # at most half of the time
            return


class LiveScene:
    """The topics of one server. `update` asks the service and publishes what changed."""

    def __init__(self, arguments: argparse.Namespace) -> None:
        self._arguments = arguments
        self._query = "?tags=" + quote(",".join(arguments.tags)) if arguments.tags else ""
        self.context = foxglove.Context()
        self._scene = SceneUpdateChannel("/scene", context=self.context)
        self._tf = FrameTransformsChannel("/tf", context=self.context)
        self._locations = LocationFixesChannel("/locations", context=self.context)
        self._tags: dict[str, _TagTopics] = {}
        self._anchors: Sequence[Json] = ()
        self._heights: dict[str, float] = {}
        self._sent: dict[str, tuple[int, str, bool]] = {}
        self._fence = EpochFence()
        self._full_s = self._site_s = 0.0
        self._told = False

    def refresh_site(self) -> None:
        """Read the anchors and the heights of the tags. Raises RefusedError."""
        self._anchors = asked(self._arguments, "GET", "/site")["anchors"]
        tags = asked(self._arguments, "GET", "/tags")["tags"]
        self._heights = {tag["tag"]: tag["settings"]["height_m"] for tag in tags}
        self._site_s = time.monotonic() + SITE_S

    def update(self) -> None:
        """Publish the poses that changed, and once per second all. Raises RefusedError."""
        if time.monotonic() >= self._site_s:
            self.refresh_site()
        found = asked(self._arguments, "GET", f"/poses{self._query}")
        poses = [pose for pose in found["poses"] if self._fence.accepts(pose["tag"], pose.get("epoch", 0))]
        full = time.monotonic() >= self._full_s
        if full:
            self._full_s = time.monotonic() + FULL_S
        self._publish([pose for pose in poses if self._is_new(pose) or full], found["t_ns"], full)

    def _is_new(self, pose: Json) -> bool:
        content = (pose["t_ns"], pose["state"], pose["online"])
        is_new = self._sent.get(pose["tag"]) != content
        self._sent[pose["tag"]] = content
        return is_new

    def _publish(self, poses: Sequence[Json], t_ns: int, full: bool) -> None:
        anchors = self._anchors if full else ()
        if not poses and not anchors:
            return
        self._heights |= {pose["tag"]: pose["z"] for pose in poses if pose.get("z") is not None}
        self._scene.log(scene(poses, anchors, self._heights, t_ns), log_time=t_ns)
        self._tf.log(transforms(poses, anchors, self._heights, t_ns), log_time=t_ns)
        if any(pose.get("lat") is not None for pose in poses):
            self._locations.log(location_fixes(poses), log_time=t_ns)
        for pose in poses:
            topics = self._topics_of(pose["tag"])
            if topics is not None:
                topics.publish(pose, self._heights.get(pose["tag"], 0.0), t_ns)

    def _topics_of(self, tag: str) -> "_TagTopics | None":
        if tag not in self._tags:
            if len(self._tags) >= MAX_TAG_TOPICS:
                if not self._told:
                    _say(
                        f"more than {MAX_TAG_TOPICS} tags: the others are on /scene and /tf only, unless you name them"
                    )
                self._told = True
                return None
            self._tags[tag] = _TagTopics(tag, self.context)
        return self._tags[tag]


class _TagTopics:
    """The topics of one tag, named as in a recording."""

    def __init__(self, tag: str, context: foxglove.Context) -> None:
        prefix = f"/tag/{chunk_from_id(tag)}"
        self._pose = PoseInFrameChannel(f"{prefix}/pose", context=context)
        self._prefix, self._context = prefix, context
        self._relative_pose: PoseInFrameChannel | None = None
        self._estimate = foxglove.Channel(f"{prefix}/estimate", schema=ESTIMATE_SCHEMA, context=context)

    def publish(self, pose: Json, height_m: float, t_ns: int) -> None:
        if is_placed(pose):
            self._pose.log(pose_in_frame(pose, height_m), log_time=t_ns)
        elif is_placed(own := in_its_frame(pose)):
            if self._relative_pose is None:
                self._relative_pose = PoseInFrameChannel(f"{self._prefix}/relative_pose", context=self._context)
            self._relative_pose.log(pose_in_frame(own, height_m), log_time=t_ns)
        known = {name: pose[name] for name in ESTIMATE_SCHEMA["properties"] if pose.get(name) is not None}
        self._estimate.log(known, log_time=t_ns)


def _say(text: str) -> None:
    sys.stderr.write(f"dropanchor foxglove: {text}\n")
    sys.stderr.flush()
