"""`nonrigid data`: make, look at, check, convert, draw and submit data sets."""

from __future__ import annotations

import typer

from nonrigid.benchmark.commands.data_check import check_command
from nonrigid.benchmark.commands.data_convert import convert_command
from nonrigid.benchmark.commands.data_info import info_command
from nonrigid.benchmark.commands.data_make import make_command
from nonrigid.benchmark.commands.data_show import show_command
from nonrigid.benchmark.commands.data_submit import submit_command

data_app = typer.Typer(
    help="Make, look at, check, convert, draw and submit sets of matching problems.",
    no_args_is_help=True,
    add_completion=False,
)
data_app.command("make")(make_command)
data_app.command("info")(info_command)
data_app.command("check")(check_command)
data_app.command("convert")(convert_command)
data_app.command("show")(show_command)
data_app.command("submit")(submit_command)
