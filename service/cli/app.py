"""The commands of `etude`, collected. Each module holds commands that belong together.

Commands import what they need when they run, so that `etude status` does not wait for numerical libraries.
"""

from __future__ import annotations

import typer

from service.cli import (
    asking,
    calibrating,
    checking,
    demonstrating,
    diagnosing,
    identifying,
    identifying_load,
    models,
    practising,
    recorded,
    returning,
    serving,
)

app = typer.Typer(
    name="etude",
    help="Identifies a robot arm, names what its simulation gets wrong, and learns motions by practice.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

app.command("up")(serving.up)
app.command("daemon")(serving.daemon)
app.command("virtual")(serving.virtual)
app.command("check")(checking.check)
app.command("status")(asking.status)
app.command("stop")(asking.stop)
app.command("reset")(asking.reset)
app.command("return")(returning.return_inside)
app.command("run")(asking.run)
identifying.app.command("load")(identifying_load.load)
app.add_typer(identifying.app, name="identify")
app.add_typer(calibrating.app, name="calibrate")
app.command("diagnose")(diagnosing.diagnose)
app.add_typer(models.app, name="model")
app.command("certify")(practising.certify)
app.command("practise")(practising.practise)
app.command("retime")(practising.retime)
app.command("compare-controllers")(practising.compare_controllers)
app.command("recordings")(recorded.recordings)
app.command("replay")(recorded.replay)
app.command("recover")(recorded.recover)
app.command("export")(recorded.export)
app.command("report")(recorded.report)
app.command("demo")(demonstrating.demo)
