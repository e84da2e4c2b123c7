"""Commands on models: `model show`, `model diff`."""

from __future__ import annotations

from typing import Annotated

import typer

from service.cli.console import publish
from service.cli.options import JsonOption, OfArmOption, require_same_arm

app = typer.Typer(help="Look at models of arms.", no_args_is_help=True, rich_markup_mode=None)

ModelArgument = Annotated[str, typer.Argument(metavar="MODEL", help="A model's file, an arm's name, or ARM@VERSION.")]


@app.callback()
def model() -> None:
    """Look at models of arms."""


@app.command("show")
def show(model: ModelArgument, arm: OfArmOption = None, json: JsonOption = None) -> None:
    """Show a model: its effects, its base parameters, and what it was learnt from."""
    from service.models.model_file import arm_model
    from service.models.store import model_path, named_model
    from service.reports.model_tables import model_report

    file = named_model(model)
    require_same_arm(model, file.arm, arm)
    # What no arm can have is not shown as if it could.
    arm_model(file)
    answer = {"file": str(model_path(model)), "address": file.address, **file.model_dump(mode="json", exclude={"urdf"})}
    publish(answer, json, *model_report(file))


@app.command("diff")
def diff(before: ModelArgument, after: ModelArgument, arm: OfArmOption = None, json: JsonOption = None) -> None:
    """Show what changes from one model to another."""
    from service.models.differences import model_difference
    from service.models.store import named_model
    from service.reports.model_tables import difference_report

    files = named_model(before), named_model(after)
    for name, file in zip((before, after), files, strict=True):
        require_same_arm(name, file.arm, arm)
    answer = model_difference(*files)
    publish(answer, json, *difference_report(answer))
