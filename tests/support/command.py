"""The command line, called in this process: a new process takes a second to import what most commands need."""

import os
import subprocess
import sys
import tempfile
import warnings
from contextlib import redirect_stderr, redirect_stdout
from unittest import mock

from overlapper.cli import main
from overlapper.cli.refusals import diverted


def overlapper(*arguments):
    """The exit code and the output of `overlapper` with these arguments, as of `subprocess.run`.

    Where PYTHONPATH puts modules in the place of others, the command has a process of its own.
    """
    words = [*map(str, arguments)]
    if "PYTHONPATH" in os.environ:
        command = [sys.executable, "-m", "overlapper", *words]
        return subprocess.run(command, capture_output=True, text=True, timeout=120)
    with tempfile.TemporaryFile() as said, tempfile.TemporaryFile() as complaints:
        with (
            diverted(1, said),
            diverted(2, complaints),
            open(1, "w", encoding="utf-8", closefd=False) as stdout,
            open(2, "w", encoding="utf-8", closefd=False) as stderr,
            redirect_stdout(stdout),
            redirect_stderr(stderr),
            mock.patch.object(sys, "argv", ["overlapper", *words]),
            warnings.catch_warnings(),
        ):
            warnings.simplefilter("default")
            warnings.simplefilter("ignore", DeprecationWarning)  # as Python ignores them, unlike pytest
            warnings.simplefilter("ignore", ResourceWarning)
            try:
                main()
            except SystemExit as end:
                code = end.code or 0
        texts = []
        for file in (said, complaints):
            file.seek(0)
            texts.append(file.read().decode())
    return subprocess.CompletedProcess(words, code, *texts)
