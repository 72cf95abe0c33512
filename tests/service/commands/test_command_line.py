"""The two programs as a person meets them at the shell: version, help, misspelt words, completion."""

import subprocess
from collections.abc import Iterable
from functools import cache
from pathlib import Path

import pytest

from dropanchor_service import cli as service_cli
from dropanchor_tag_client import cli as tag_cli
from support.commands import Ended, called, python

PROGRAMS = {"dropanchor": "dropanchor_service", "dropanchor-tag": "dropanchor_tag_client"}
COMMANDS: dict[str, Iterable[str]] = {"dropanchor": service_cli._COMMANDS, "dropanchor-tag": tag_cli._COMMANDS}
EVERY_COMMAND = [(program, command) for program, commands in COMMANDS.items() for command in commands]
MISSPELT = [
    ("dropanchor", ["serv"], "serve"),
    ("dropanchor", ["serve", "--prot", "8081"], "--port"),
    ("dropanchor", ["serve", "--log-level=DEBUGG"], "DEBUG"),
    ("dropanchor", ["key", "ad", "anna"], "add"),
    ("dropanchor", ["key", "add", "anna", "--scoop=read"], "--scope"),
    ("dropanchor-tag", ["simulat"], "simulate"),
    ("dropanchor-tag", ["simulate", "--conect", "tcp/127.0.0.1:1"], "--connect"),
    ("dropanchor-tag", ["simulate", "--noise", "calibratd"], "calibrated"),
]


@cache
def answers(program: str) -> dict[tuple[str, ...], Ended]:
    """Return what the program says to the misspelt words and to a question for help with each command."""
    misspelt = [tuple(words) for one, words, _ in MISSPELT if one == program]
    calls = [*misspelt, *((command, "--help") for command in COMMANDS[program])]
    return dict(zip(calls, called(PROGRAMS[program], calls), strict=True))


@cache
def completion(program: str) -> str:
    made = python("-m", PROGRAMS[program], "completion", "bash")
    assert made.returncode == 0, made.stderr
    return made.stdout


@pytest.mark.parametrize("program", PROGRAMS)
def test_the_version_is_that_of_the_distribution(program: str) -> None:
    ended = python("-m", PROGRAMS[program], "--version")
    (version,) = {line for line in Path("service/pyproject.toml").read_text().splitlines() if "version =" in line}
    assert ended.stdout.split() == [program, version.split('"')[1]]


@pytest.mark.parametrize(("program", "words", "meant"), MISSPELT)
def test_a_misspelt_word_is_refused_with_the_nearest_one(program: str, words: list[str], meant: str) -> None:
    ended = answers(program)[tuple(words)]
    assert ended.returncode == 2
    assert ended.stderr.splitlines()[-1].endswith(f"did you mean {meant}?"), ended.stderr


def test_a_word_like_no_other_is_refused_with_all_choices() -> None:
    last = python("-m", "dropanchor_tag_client", "zzz").stderr.splitlines()[-1]
    assert "choose from replay, simulate, publish" in last
    assert "did you mean" not in last


@pytest.mark.parametrize(("program", "command"), EVERY_COMMAND)
def test_the_help_of_every_command_has_an_example(program: str, command: str) -> None:
    ended = answers(program)[command, "--help"]
    assert ended.returncode == 0, ended.stderr
    assert "examples:" in ended.stdout or "example:" in ended.stdout
    assert f"{program} {command}" in ended.stdout.partition("example")[2]


def test_a_tag_reports_nothing_below_its_log_level() -> None:
    words = ("-m", "dropanchor_tag_client", "publish", "--tag=cart", "--connect=tcp/127.0.0.1:1")
    loud = python(*words, "--connect-timeout=0.1", text_input="")
    quiet = python(*words, "--connect-timeout=0.1", "--log-level=ERROR", text_input="")
    assert loud.returncode == quiet.returncode == 2
    assert len(quiet.stderr.splitlines()) <= len(loud.stderr.splitlines())


@pytest.mark.parametrize(
    ("program", "words", "expected"),
    [
        ("dropanchor", ["dropanchor", "rec"], {"record"}),
        ("dropanchor", ["dropanchor", "serve", "--zenoh"], {"--zenoh-listen", "--zenoh-connect"}),
        ("dropanchor-tag", ["dropanchor-tag", "sim"], {"simulate"}),
        ("dropanchor-tag", ["dropanchor-tag", "publish", "--spool"], {"--spool", "--spool-limit"}),
    ],
)
def test_bash_completes_commands_and_options(
    program: str, words: list[str], expected: set[str], tmp_path: Path
) -> None:
    script = tmp_path / program
    script.write_text(completion(program))
    quoted = " ".join(words)
    ask = f"""
source {script}
COMP_WORDS=({quoted}); COMP_CWORD={len(words) - 1}; COMP_LINE="{quoted}"; COMP_POINT=${{#COMP_LINE}}
function=$(complete -p {program} | sed 's/.*-F \\([^ ]*\\) .*/\\1/')
$function
printf '%s\\n' "${{COMPREPLY[@]}}"
"""
    offered = subprocess.run(["bash", "-c", ask], check=True, capture_output=True, text=True).stdout.split()
    assert set(offered) == expected
