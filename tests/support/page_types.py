"""Check the types in the page's modules, which stand in their comments (JSDoc), with the TypeScript compiler.

The compiler comes from npm once and stays beside the virtual environment, so later runs need no network.
"""

import json
import shutil
import subprocess
import sys
from pathlib import Path

from support.node_packages import problem_of_install

ROOT = Path(__file__).parents[2]
PROJECT = ROOT / "tests" / "service" / "dashboard" / "tsconfig.json"
FOLDER = Path(sys.prefix) / "typescript"
_PACKAGE = ROOT / "tag_client" / "typescript" / "package.json"  # names the version that all of the project uses


def problem_of_compiler(folder: Path) -> str | None:
    """Install the compiler unless it is there. Return why there is none, None if there is one."""
    wanted = json.loads(_PACKAGE.read_text(encoding="utf-8"))["devDependencies"]["typescript"]
    installed = folder / "node_modules" / "typescript" / "package.json"
    if installed.exists() and json.loads(installed.read_text(encoding="utf-8"))["version"] == wanted:
        return None if shutil.which("node") else "node is not installed"
    folder.mkdir(exist_ok=True)
    return problem_of_install(folder, f"typescript@{wanted}")


def errors_in(project: Path, folder: Path) -> str:
    """Return what the compiler finds in a project, a line each; empty: nothing."""
    command = ["node", str(folder / "node_modules/typescript/bin/tsc"), "--project", str(project), "--pretty", "false"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    return done.stdout + done.stderr if done.returncode else ""


def main() -> int:
    problem = problem_of_compiler(FOLDER)
    if problem is not None:
        sys.stderr.write(f"The types of the page are not checked: {problem}.\n")
        return 0
    errors = errors_in(PROJECT, FOLDER)
    sys.stderr.write(errors)
    return 1 if errors else 0


if __name__ == "__main__":
    sys.exit(main())
