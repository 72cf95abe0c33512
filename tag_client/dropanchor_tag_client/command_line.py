"""The command-line parser of both programs: it suggests the nearest name for a misspelt one."""

import argparse
import os
from collections.abc import Iterable
from typing import Any

LOG_LEVELS = ("DEBUG", "INFO", "WARNING", "ERROR")
SHELLS = ("bash", "zsh", "tcsh")
COMPLETION = "print the script that completes commands and options in a shell"


class _Formatter(argparse.RawDescriptionHelpFormatter):
    """Help as wide as the terminal. Without a width, argparse loads shutil, which loads 1 MB of compression."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, width=_width() - 2)


def _width() -> int:
    try:
        return int(os.environ.get("COLUMNS", "")) or os.get_terminal_size().columns
    except (ValueError, OSError):
        return 80


class Parser(argparse.ArgumentParser):
    """Shows descriptions and examples as they are written. Its subparsers are of this class, too."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **{"formatter_class": _Formatter, **options})

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> tuple[Any, list[str]]:
        """Refuse unknown arguments here, where the options of the subcommand are known."""
        found, unknown = super().parse_known_args(args, namespace)
        if unknown:
            names = [name for name in self._option_string_actions if name.startswith("--")]
            option = next((word for word in unknown if word.startswith("-")), "").partition("=")[0]
            self.error(f"unrecognized arguments: {' '.join(unknown)}{did_you_mean(option, names)}")
        return found, unknown

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            names = [str(choice) for choice in action.choices]
            hint = did_you_mean(str(value), names) or f" (choose from {', '.join(names)})"
            raise argparse.ArgumentError(action, f"invalid choice: {str(value)!r}{hint}")


def did_you_mean(word: str, names: Iterable[str]) -> str:
    """Return "; did you mean NAME?" for the name that is nearest to a word, and nothing if none is near."""
    import difflib  # 0.2 MB, and only a misspelt name needs it

    nearest = difflib.get_close_matches(word, list(names), 1)
    return f"; did you mean {nearest[0]}?" if nearest else ""


def explain_actions(command: argparse.ArgumentParser) -> None:
    """Let the help of each action of a command describe it, with those examples of the command that call it."""
    for actions in command._actions:
        if isinstance(actions, argparse._SubParsersAction):
            briefs = {choice.dest: choice.help or "" for choice in actions._choices_actions}
            for name, action in actions.choices.items():
                action.description = f"{briefs[name][:1].upper()}{briefs[name][1:]}."
                lines = [line for line in (command.epilog or "").splitlines() if f"{action.prog} " in f"{line} "]
                action.epilog = "\n".join(["examples:", *lines, ""])


def add_completion_arguments(parser: argparse.ArgumentParser, program: str) -> None:
    parser.add_argument("shell", choices=SHELLS, metavar="SHELL", help=" or ".join(SHELLS))
    parser.description = "Prints the script that completes the commands and options of this program in a shell."
    parser.epilog = f"""examples:
  {program} completion bash > ~/.local/share/bash-completion/completions/{program}
  {program} completion zsh > ~/.zfunc/_{program}      with ~/.zfunc in $fpath
"""


def completion_script(parser: argparse.ArgumentParser, shell: str) -> str:
    """Return the script for a shell. Raises ModuleNotFoundError without shtab."""
    import shtab  # only this command needs it

    return str(shtab.complete(parser, shell))
