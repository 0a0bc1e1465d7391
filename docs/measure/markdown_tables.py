"""Markdown tables and pages: words lie in templates, numbers are filled in."""

import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from string import Template

TEMPLATES = Path(__file__).parent / "templates"


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table whose first column is text and whose others are figures, to the right."""
    rule = ["---", *["---:"] * (len(header) - 1)]
    return "".join(f"| {' | '.join(line)} |\n" for line in [header, rule, *rows])


def millimetres(value: float | None) -> str:
    """Return a velocity in m/s as mm/s: two digits below 10, else one."""
    if value is None:
        return "-"
    scaled = 1e3 * value
    return f"{scaled:.2f}" if scaled < 9.995 else f"{scaled:.1f}"


def percent(value: float | None, meaningful: bool = True) -> str:
    """Return a percentage, in brackets where it means nothing."""
    if value is None:
        return "-"
    return f"{value:.1f}" if meaningful else f"({value:.1f})"


def filled(template: str, values: Mapping[str, object]) -> str:
    """Return a template with its values; raises KeyError for one that is missing."""
    text = Template((TEMPLATES / template).read_text(encoding="utf-8"))
    return text.substitute({name: str(value) for name, value in values.items()}).strip()


def fill(page: Path, values: Mapping[str, object], template: str | None = None) -> None:
    """Write a page from a template, that of its own name if none is named."""
    text = re.sub(r"\n{3,}", "\n\n", filled(template or page.name, values)) + "\n"
    page.write_text(text, encoding="utf-8")
    print(f"{page.name}: {len(text.splitlines())} lines", file=sys.stderr)
