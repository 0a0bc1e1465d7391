"""Reports for people: a verdict line, then a table of the findings."""

from __future__ import annotations

from collections import Counter
from typing import Final, TextIO

from cosim.check.finding import Finding, Report, numbered

SHOWN: Final = 10  # findings of one code; --json has all


def verdict(report: Report) -> str:
    """Return the line that says how it went."""
    errors, warnings = report.count("error"), report.count("warning")
    found = (
        f"{numbered(errors, 'defect')}, {numbered(warnings, 'warning')}"
        if errors
        else f"no defects, {numbered(warnings, 'warning')}"
    )
    version = f"FMI {report.fmi_version}, " if report.fmi_version else ""
    trials = f"; {numbered(len(report.trials), 'trial')} run" if report.trials else "; not run"
    return f"{report.path}: {version}{found}{trials}"


def show(report: Report, out: TextIO) -> None:
    """Print a report, as a rich table on a terminal and as plain text elsewhere."""
    rows, left_out = _shown(report)
    if out.isatty():
        _show_rich(report, rows, out)
    else:
        _show_plain(report, rows, out)
    for code, count in left_out.items():
        print(f"  and {count} more of {code}; --json shows all", file=out)
    for sentence in report.not_judged:
        print(f"  not judged: {sentence}", file=out)


def _shown(report: Report) -> tuple[list[Finding], Counter[str]]:
    rows: list[Finding] = []
    seen: Counter[str] = Counter()
    for finding in report.findings:
        seen[finding.code] += 1
        if seen[finding.code] <= SHOWN:
            rows.append(finding)
    return rows, Counter({code: n - SHOWN for code, n in seen.items() if n > SHOWN})


def _show_plain(report: Report, rows: list[Finding], out: TextIO) -> None:
    print(verdict(report), file=out)
    widths = [
        max((len(getattr(row, name)) for row in rows), default=0) for name in ("code", "where")
    ]
    for row in rows:
        cells = (row.severity.ljust(7), row.code.ljust(widths[0]), row.where.ljust(widths[1]))
        print("  " + "  ".join((*cells, row.message)), file=out)


def _show_rich(report: Report, rows: list[Finding], out: TextIO) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    console = Console(file=out)
    colour = "red" if report.count("error") else "green"
    console.print(Text(verdict(report), style=f"bold {colour}"))
    if not rows:
        return
    table = Table(box=box.SIMPLE_HEAD)
    table.add_column("code", no_wrap=True)
    table.add_column("where", overflow="fold", max_width=32)
    table.add_column("what", overflow="fold")
    for row in rows:
        style = "red" if row.severity == "error" else "yellow"
        table.add_row(Text(row.code, style=style), Text(row.where), Text(row.message))
    console.print(table)
