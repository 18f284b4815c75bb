"""What every notebook of the book begins with: `%%bash` gives one text, as on paper, and fails with its command."""

import os
import subprocess

from IPython import get_ipython

shell = get_ipython()
for name in ("FORCE_COLOR", "CLICOLOR", "CLICOLOR_FORCE"):
    os.environ.pop(name, None)
os.environ |= {"NO_COLOR": "1", "COLUMNS": "92"}


def bash(_line: str, cell: str) -> None:
    """Run a cell by bash and print what it prints; IPython's own gives it in pieces."""
    run = subprocess.run(["bash", "-euo", "pipefail", "-c", cell], capture_output=True, text=True, check=False)
    print((run.stdout + run.stderr).rstrip())
    if run.returncode:
        raise SystemError(f"exit code {run.returncode}")


if shell is not None:
    shell.register_magic_function(bash, "cell", "bash")
    shell.run_line_magic("matplotlib", "inline")
