"""`dropanchor cluster start`, `supervise` and `stop`: make this machine a node of a cluster, and end that."""

import argparse
import os
import re
import socket
import time
from functools import partial
from pathlib import Path
from typing import Any

from dropanchor_service.cluster.database import connect
from dropanchor_service.commands.cluster_options import refuse
from dropanchor_service.commands.options import add_log_option, positive
from dropanchor_service.ownership.in_cluster import checkpoint_folder_of, digest_of_sites, refuse_unfit
from dropanchor_service.runtime import logs
from dropanchor_service.settings.model import Settings
from dropanchor_service.settings.sources import SettingsError, load_settings
from dropanchor_service.shards.actor import CONFIG
from dropanchor_service.shards.node_lock import node_lock, running_node
from dropanchor_service.shards.ray_node import LONGEST_FOLDER, RayNode, ray_settings, require_ray
from dropanchor_service.shards.token_file import made_or_read

STOP_S = 90.0


def add_actions(actions: Any) -> None:
    start = actions.add_parser("start", help="make this machine a node, until Ctrl-C or SIGTERM")
    role = start.add_mutually_exclusive_group(required=True)
    role.add_argument("--head", action="store_true", help="look after nodes and shards, too")
    role.add_argument(
        "--join", nargs="?", const="", metavar="ADDRESS", help="join this head (default: the one in the database)"
    )
    start.add_argument("--port", type=positive, default=6379, help="port of the head (default: %(default)s)")
    start.add_argument("--shards", type=int, metavar="N", help="shards of this node (default: cores; head: 0)")
    supervise = actions.add_parser("supervise", help="be the head of nodes that something else starts, as KubeRay does")
    supervise.add_argument("--ray", required=True, metavar="ADDRESS", help="address and port of Ray")
    stop = actions.add_parser("stop", help="move the buckets off this node, and stop it")
    for action in (start, supervise):
        action.add_argument("--address", metavar="IP", help="of this machine, for the others (default: Ray's guess)")
        action.add_argument("--token", type=Path, metavar="FILE", help="token of all nodes (default: FOLDER/token)")
    for action, act in ((start, _start), (supervise, _supervise), (stop, _stop)):
        action.add_argument("--config", type=Path, required=True, metavar="FILE", help="settings file (TOML)")
        action.add_argument("--folder", type=Path, help="for token, state and logs (default: data_dir/cluster)")
        add_log_option(action)
        action.set_defaults(act=act)


def _start(arguments: argparse.Namespace) -> int:
    logs.configure(arguments.log_level)
    require_ray()
    settings, folder = _settings_of(arguments), _folder_of(arguments)
    with node_lock(folder):
        token = made_or_read(arguments.token or folder / "token", may_make=arguments.head)
        _set_up_ray(token, arguments.config)
        from dropanchor_service.shards.node_process import run_node
        from dropanchor_service.shards.on_ray import address_of_this_machine

        node = RayNode(
            name=name_of(settings),
            folder=folder,
            address=arguments.address or address_of_this_machine(),
            head=None if arguments.head else arguments.join,
            port=arguments.port,
            shards=_shards_of(arguments),
        )
        return run_node(node, _connector(settings), digest_of_sites(settings))


def _supervise(arguments: argparse.Namespace) -> int:
    logs.configure(arguments.log_level)
    require_ray()
    settings, folder = _settings_of(arguments), _folder_of(arguments)
    _set_up_ray(made_or_read(arguments.token or folder / "token", may_make=False), arguments.config)
    from dropanchor_service.shards.node_process import supervise
    from dropanchor_service.shards.on_ray import address_of_this_machine

    address, connector = arguments.address or address_of_this_machine(), _connector(settings)
    return supervise(name_of(settings), arguments.ray, address, connector, digest_of_sites(settings))


def _stop(arguments: argparse.Namespace) -> int:
    folder = _folder_of(arguments)
    owner = running_node(folder)
    if owner is None:
        return refuse(f"no node runs with the folder {folder}")
    if owner.host not in ("", socket.gethostname()):
        return refuse(f"the node of {folder} is {owner}: stop it there")
    os.kill(owner.pid, 15)
    end_s = time.monotonic() + STOP_S
    while time.monotonic() < end_s:
        if running_node(folder) != owner:
            print("The node has stopped.")
            return 0
        time.sleep(0.1)
    return refuse(f"the node ({owner}) has not stopped within {STOP_S:.0f} s")


def _set_up_ray(token: Path, config: Path) -> None:
    """Set what Ray reads when it is imported, and what its processes inherit."""
    os.environ.update({CONFIG: str(config.absolute()), **ray_settings(token)})


def name_of(settings: Settings) -> str:
    """Return the name of this node. Raises SettingsError if it cannot be one."""
    name = settings.cluster.name or socket.gethostname()
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}", name):
        raise SettingsError(f"cluster.name: {name!r} cannot name a node: use letters, digits, dots and hyphens")
    return name


def _settings_of(arguments: argparse.Namespace) -> Settings:
    settings = load_settings(arguments.config)
    if settings.cluster.url is None:
        raise SettingsError("cluster.url: set the PostgreSQL database of the cluster")
    refuse_unfit(settings)
    checkpoint_folder_of(settings)
    return settings


def _connector(settings: Settings) -> Any:
    return partial(connect, settings.cluster.url or "", name_of(settings))


def _folder_of(arguments: argparse.Namespace) -> Path:
    data_dir = load_settings(arguments.config).data_dir
    if arguments.folder is None and data_dir is None:
        raise ValueError("say where Ray keeps its state: --folder FOLDER, or set data_dir")
    folder = Path(arguments.folder or f"{data_dir}/cluster").absolute()
    if len(os.fsencode(folder)) > LONGEST_FOLDER:
        raise ValueError(f"{folder} is too long for Ray's sockets: choose a --folder of {LONGEST_FOLDER} bytes at most")
    return folder


def _shards_of(arguments: argparse.Namespace) -> int:
    if arguments.shards is None:
        return 0 if arguments.head else os.cpu_count() or 1
    if arguments.shards < 0:
        raise ValueError("--shards: 0 or more")
    return int(arguments.shards)
