"""A systemd unit that keeps a command running: from the start of the machine, and again after a failure."""

import argparse
import getpass
import re
import shlex
import sys
from pathlib import Path

from dropanchor_tag_client.cli import parser

_COMMANDS = ("serial", "imu", "mqtt")
_GROUPS = {"serial": "dialout", "imu": "i2c"}
_SAFE = re.compile(r"[\w@%+=:,./-]+", re.ASCII)
_UNIT_NAME = re.compile(r"[\w:.@\\-]{1,255}", re.ASCII)  # systemd.unit(5)
_UNIT = """[Unit]
Description=Dropanchor: {description}
Wants=network-online.target
After=network-online.target

[Service]
ExecStart={command}
WorkingDirectory={folder}
EnvironmentFile=-{environment}
{identity}Restart=always
RestartSec=2
TimeoutStopSec=15
NoNewPrivileges=yes

[Install]
WantedBy={target}
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--user", action="store_true", help="write the unit for this user; without it, print one")
    parser.add_argument("--unit", metavar="NAME", help="name of the unit (default: dropanchor-tag-<tag>)")
    parser.add_argument("words", nargs=argparse.REMAINDER, metavar="COMMAND …", help=f"one of {', '.join(_COMMANDS)}")
    parser.set_defaults(credentials=None, site=None, connect=None)


def run(arguments: argparse.Namespace) -> int:
    """Raises ValueError. Exits with code 2 where the command itself is wrong."""
    words = [word for word in arguments.words if word != "--"]
    if not words or words[0] not in _COMMANDS:
        raise ValueError(f"no command was given: add one of {', '.join(_COMMANDS)} with its options")
    given = parser(words[0]).parse_args(words)
    name = f"{arguments.unit or _name(given)}.service"
    if not _UNIT_NAME.fullmatch(name):
        raise ValueError(f"--unit {arguments.unit!r} cannot name a unit: use letters, digits and : - _ . \\ @")
    if not arguments.user:
        sys.stdout.write(unit(words, for_user=False))
        _say(f"Save this as /etc/systemd/system/{name}, then: systemctl enable --now {name}")
        return 0
    path = Path.home() / ".config" / "systemd" / "user" / name
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(unit(words, for_user=True))
    except OSError as error:
        raise ValueError(f"{path} cannot be written: {error.strerror}") from error
    _say(f"{path} is written. Then: systemctl --user daemon-reload && systemctl --user enable --now {name}")
    _say("To run before anybody logs in: loginctl enable-linger")
    return 0


def unit(words: list[str], *, for_user: bool) -> str:
    """Return the unit that runs this command in the folder from which it was installed."""
    group = _GROUPS.get(words[0])
    groups = f"SupplementaryGroups={group}\n" if group else ""
    command = [sys.executable, "-m", "dropanchor_tag_client", *words]
    return _UNIT.format(
        description=shlex.join(words).replace("%", "%%").replace("\n", " "),
        command=" ".join(quoted(word) for word in command),
        folder=str(Path.cwd()).replace("%", "%%"),
        environment="%h/.config/dropanchor/tag.env" if for_user else "/etc/dropanchor/tag.env",
        identity="" if for_user else f"User={getpass.getuser()}\n{groups}",
        target="default.target" if for_user else "multi-user.target",
    )


def quoted(word: str) -> str:
    """Return a word of a command line as systemd reads it: see systemd.service(5), "Command lines"."""
    escaped = word.replace("\\", "\\\\").replace('"', '\\"').replace("%", "%%").replace("$", "$$").replace("\n", "\\n")
    return escaped if _SAFE.fullmatch(word) else f'"{escaped}"'


def _name(given: argparse.Namespace) -> str:
    tag = getattr(given, "tag", None) or Path(given.credentials or given.command).name
    return "dropanchor-tag-" + re.sub(r"[^\w.-]", "-", tag, flags=re.ASCII)


def _say(text: str) -> None:
    sys.stderr.write(f"{text}\n")
