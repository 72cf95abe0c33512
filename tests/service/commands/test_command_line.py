"""The two programs as a person meets them at the shell: version, help, misspelt words, completion."""

import argparse
import subprocess
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import pytest

from dropanchor_service import cli as service_cli
from dropanchor_tag_client import cli as tag_cli
from support.commands import Ended, called, python

PROGRAMS = {"dropanchor": "dropanchor_service", "dropanchor-tag": "dropanchor_tag_client"}
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
    """Return what the program says to the misspelt words."""
    calls = [tuple(words) for one, words, _ in MISSPELT if one == program]
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


def below(parser: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    """Yield a parser and those of all its commands and their actions."""
    yield parser
    for actions in parser._actions:
        if isinstance(actions, argparse._SubParsersAction):
            for one in actions.choices.values():
                yield from below(one)


def is_explained(parser: argparse.ArgumentParser) -> bool:
    """Return whether the help describes a command and has an example that calls it."""
    text = parser.format_help()
    examples = text.rpartition("\nexample")[2].splitlines()
    described = " ".join((parser.description or "nothing").split()) in " ".join(text.split())
    return described and any(f"{parser.prog} " in f"{line} " for line in examples)


@pytest.mark.parametrize(
    "parse",
    [lambda: service_cli._parser(service_cli._COMMANDS), lambda: tag_cli.parser(*tag_cli._COMMANDS)],
    ids=PROGRAMS,
)
def test_the_help_of_every_command_and_of_its_actions_describes_it_and_has_an_example(
    parse: Callable[[], argparse.ArgumentParser],
) -> None:
    found = list(below(parse()))
    assert len(found) > 8
    assert [one.prog for one in found if not is_explained(one)] == []


def test_the_help_of_serve_says_where_its_other_settings_are() -> None:
    said = called("dropanchor_service", [["serve", "--help"]])[0].stdout
    assert "dropanchor settings --show" in said
    assert "service/docs/reference/settings.md" in said


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
