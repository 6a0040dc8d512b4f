"""Files that are made from templates of the package."""

from functools import cache

import jinja2


@cache
def _templates(package: str) -> jinja2.Environment:
    return jinja2.Environment(
        loader=jinja2.PackageLoader(package),
        undefined=jinja2.StrictUndefined,
        keep_trailing_newline=True,
        trim_blocks=True,
    )


def fill(package: str, name: str, /, **known: object) -> str:
    """The text of a template in the folder `templates` of a package."""
    return _templates(package).get_template(f"{name}.j2").render(known)
