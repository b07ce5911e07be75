"""The command line: `nonrigid match`, `score`, `data`, `solvers`, `bench`, `report`, `cite` and others."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from typing import Any

import typer
from typer.core import TyperGroup

from nonrigid.benchmark.commands.bench import bench_command
from nonrigid.benchmark.commands.cache import cache_command
from nonrigid.benchmark.commands.cite import cite_command
from nonrigid.benchmark.commands.data import data_app
from nonrigid.benchmark.commands.match import match_command
from nonrigid.benchmark.commands.merge import merge_command
from nonrigid.benchmark.commands.report import report_command
from nonrigid.benchmark.commands.score import score_command
from nonrigid.benchmark.commands.solvers import solvers_command
from nonrigid.benchmark.commands.train import train_command
from nonrigid.benchmark.commands.view import view_command
from nonrigid.geometry.errors import NonrigidError

# The exception at the root of what the option parser raises; its module has moved between versions of typer.
_Complaint: type[Exception] = typer.BadParameter.__mro__[2]


_INTERRUPTED = 130
"""Exit code after Ctrl-C, as shells have it: 128 and the number of the signal."""


class OneLineErrors(TyperGroup):
    """Report what the user can mend in one line on standard error, with exit code 2 and no traceback."""

    def main(
        self,
        args: Sequence[str] | None = None,
        prog_name: str | None = None,
        complete_var: str | None = None,
        standalone_mode: bool = True,
        windows_expand_args: bool = True,
        **extra: Any,
    ) -> Any:
        """Run a command and leave with its exit code: 0 done, 1 a solve failed, 2 bad input, 130 interrupted."""
        try:
            code = super().main(
                args=args,
                prog_name=prog_name,
                complete_var=complete_var,
                standalone_mode=False,
                windows_expand_args=windows_expand_args,
                **extra,
            )
        except (NonrigidError, OSError) as error:
            code = _complain(str(error))
        except _Complaint as error:
            code = _complain(error.format_message())  # type: ignore[attr-defined]
        except (typer.Abort, KeyboardInterrupt):
            code = _INTERRUPTED
        if code == _INTERRUPTED:  # to which newer versions of typer turn Ctrl-C themselves
            code = _complain("interrupted; finished runs are kept", code=_INTERRUPTED)
        sys.exit(code if isinstance(code, int) else 0)


app = typer.Typer(
    name="nonrigid",
    cls=OneLineErrors,
    help="Match parts of deformable surfaces by declarative optimization, with any solver, and score the answers.",
    no_args_is_help=False,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
app.command("match")(match_command)
app.command("score")(score_command)
app.command("solvers")(solvers_command)
app.command("bench")(bench_command)
app.command("merge")(merge_command)
app.command("report")(report_command)
app.command("train")(train_command)
app.command("view")(view_command)
app.command("cite")(cite_command)
app.add_typer(data_app, name="data")
app.command("cache")(cache_command)


def main() -> None:
    """Run the command line with one BLAS thread a process: parallelism is over pairs."""
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    app()


def _complain(message: str, code: int = 2) -> int:
    typer.echo(f"nonrigid: {' '.join(message.split())}", err=True)
    return code
