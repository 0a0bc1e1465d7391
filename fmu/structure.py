"""What the outputs of a model depend on when initialisation is left: table ``[initial]``.

An importer breaks loops between FMUs with it: a controller that answers an output with an input
need not be iterated if that output does not depend on that input.

    [initial]
    without = ["DM.Gas"]              # no output depends on it, but for those of `only`
    nothing = ["Car.YawRate"]         # outputs that depend on nothing that can be set
    [initial.only]
    "Car.Damp@.Ctrl" = ["Car.Damper@.CtrlOut"]   # and outputs that depend on these alone

A name holding ``@`` stands for the four corners. An output that is not named depends on everything
that can be set except `without`. Without the table nothing is said, and importers assume all.
"""

from typing import Any

from table import CORNERS


def each_corner(names: list[str], corners: tuple[str, ...] = CORNERS) -> list[str]:
    """Names of scalars: "@" becomes each corner."""
    return [n.replace("@", c) for n in names for c in (corners if "@" in n else ("",))]


def initial_dependencies(
    raw: dict[str, Any], outputs: list[str], knowns: list[str], problems: list[str]
) -> dict[str, list[str]]:
    """By output the variables that can be set and that it depends on; empty without a table."""
    if not raw:
        return {}
    unknown = sorted(set(raw) - {"without", "nothing", "only"})
    problems += [f"[initial]: unknown key '{key}'" for key in unknown]
    without = set(each_corner(raw.get("without", [])))
    rest = [name for name in knowns if name not in without]
    dependencies = dict.fromkeys(outputs, rest)
    special: dict[str, list[str]] = {name: [] for name in each_corner(raw.get("nothing", []))}
    for pattern, on in raw.get("only", {}).items():
        for corner in CORNERS if "@" in pattern else ("",):
            special[pattern.replace("@", corner)] = each_corner(
                on, (corner,) if corner else CORNERS
            )
    named = {name for on in special.values() for name in on} | without
    problems += [
        f"[initial]: there is no output '{n}'" for n in sorted(set(special) - set(outputs))
    ]
    problems += [f"[initial]: '{n}' cannot be set" for n in sorted(named - set(knowns))]
    return {**dependencies, **special}
