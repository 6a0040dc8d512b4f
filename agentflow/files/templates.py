"""Files that are made from templates of the package."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import jinja2


@cache
def _templates(package: str) -> jinja2.Environment:
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader(package),
        undefined=jinja2.StrictUndefined,
        keep_trailing_newline=True,
        trim_blocks=True,
    )
    environment.filters["g"] = "{:g}".format
    return environment


def fill(package: str, name: str, /, **known: object) -> str:
    """The text of a template in the folder `templates` of a package; `g` formats numbers."""
    return _templates(package).get_template(f"{name}.j2").render(known)
