"""The page of a comparison: one HTML file that needs no network."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import resources
from pathlib import Path

from cosim.comparison.plots import plots_of
from cosim.comparison.read import ComparedRun
from cosim.report import as_script, uplot
from cosim.tables import Table


def write_page(runs: Sequence[ComparedRun], table: Table, command: str, path: Path) -> None:
    """Write the page to `path`; raises `ReportError` where uplot-python is not installed."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    script, style = uplot()
    loader = PackageLoader("cosim.comparison", "templates")
    environment = Environment(loader=loader, autoescape=True, undefined=StrictUndefined)
    own = resources.files("cosim.comparison") / "templates" / "compare.js"
    shared = resources.files("cosim.report") / "templates" / "report.css"
    page = environment.get_template("compare.html").render(
        scenarios=list(dict.fromkeys(run.scenario for run in runs)),
        table=table,
        command=command,
        uplot_script=script,
        uplot_style=style,
        script=own.read_text(encoding="utf-8"),
        style=shared.read_text(encoding="utf-8"),
        data=as_script(plots_of(runs)),
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(page, encoding="utf-8")
