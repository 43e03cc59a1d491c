"""`hj-cosim examples`: the scripts that come with the package."""

import ast
from importlib.resources import files
from typing import Annotated

import typer

from hj_cosim.cli.app import Json, app, example
from hj_cosim.cli.console import print_json, show_rows
from hj_cosim.errors import ConfigurationError


@app.command(epilog=example("hj-cosim examples", "hj-cosim examples drive_and_plot > mine.py"))
def examples(
    name: Annotated[str | None, typer.Argument(help="Which to print; without one, all are listed.")] = None,
    as_json: Json = False,
) -> None:
    """List the examples in Python, or print one, to start one's own script from."""
    folder = files("hj_cosim.examples")
    texts = {
        place.name.removesuffix(".py"): place.read_text(encoding="utf-8")
        for place in sorted(folder.iterdir(), key=lambda place: place.name)
        if place.name.endswith(".py") and place.name != "__init__.py"
    }
    if name is None:
        rows = [{"name": key, "shows": ast.get_docstring(ast.parse(text))} for key, text in texts.items()]
        show_rows("examples", rows, as_json)
    elif name.removesuffix(".py") not in texts:
        raise ConfigurationError(f"no example is called {name!r}; choose one of {', '.join(texts)}")
    elif as_json:
        print_json({"name": name, "text": texts[name.removesuffix(".py")]})
    else:
        print(texts[name.removesuffix(".py")], end="")
