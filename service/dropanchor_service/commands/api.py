"""`dropanchor api`: run an API node of a cluster until it is stopped."""

import argparse

from dropanchor_service.api.http.server import ListenError
from dropanchor_service.commands.options import add_http_options, add_log_option, add_security_options, given
from dropanchor_service.node.node import Node
from dropanchor_service.runtime import logs, open_files
from dropanchor_service.runtime.signals import interrupts
from dropanchor_service.runtime.systemd import Systemd
from dropanchor_service.settings.model import Settings
from dropanchor_service.settings.sources import SettingsError, load_settings

DESCRIPTION = """\
Runs an API node until Ctrl-C or SIGTERM: it has the page and the REST interface of all sites of a cluster, and passes
each request on to the process that owns the site. It keeps nothing, so any number may run behind a load balancer.
"""
EPILOG = """\
examples:
  dropanchor api --config yard.toml --port 8090
  dropanchor api --url postgresql://dropanchor@db.example/dropanchor --node-secret /etc/dropanchor/node.secret
"""
REFUSED = (SettingsError, ListenError)
EXIT_DIED = 1


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_http_options(parser)
    parser.add_argument("--url", metavar="URL", help="PostgreSQL database of the cluster (cluster.url)")
    parser.add_argument(
        "--node-secret", metavar="FILE", help="secret that the services have, too (cluster.node_secret)"
    )
    add_security_options(parser)
    add_log_option(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the node. Return 0 if it was stopped, 1 if it died. Raises REFUSED if it cannot start."""
    logs.configure(arguments.log_level)
    open_files.raise_limit()
    systemd = Systemd()
    with interrupts() as interrupt, Node(_settings_of(arguments)) as node:
        systemd.ready()
        stopped = interrupt.wait(lambda: _supervise(node, systemd))
        systemd.stopping()
    return 0 if stopped else EXIT_DIED


def _supervise(node: Node, systemd: Systemd) -> bool:
    if node.is_alive:
        systemd.progress()
    return node.is_alive


def _settings_of(arguments: argparse.Namespace) -> Settings:
    any_bucket = {"bucket": "any"} if arguments.url is not None and arguments.config is None else {}
    options = {
        "http": given(host=arguments.host, port=arguments.port),
        "cluster": given(url=arguments.url, node_secret=arguments.node_secret) | any_bucket,
        "security": given(folder=arguments.security),
        **given(insecure=arguments.insecure),
    }
    return load_settings(arguments.config, {key: value for key, value in options.items() if value != {}})
