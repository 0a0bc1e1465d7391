"""Facts on the terminal: rich tables where someone looks, plain ones elsewhere."""

from __future__ import annotations

from typing import TextIO

from cosim.inspect.facts import Facts, Table


def show(facts: Facts, out: TextIO) -> None:
    """Print the headline, the tables and the notes."""
    terminal = out.isatty()
    print(facts.headline, file=out)
    for table in facts.tables:
        print(file=out)
        (_rich if terminal else _plain)(table, out)
        if table.hidden:
            print(f"  and {table.hidden} more; --all shows them", file=out)
    for note in facts.notes:
        print(f"note: {note}", file=out)


def _plain(table: Table, out: TextIO) -> None:
    print(table.title, file=out)
    lines = [*([table.columns] if any(table.columns) else []), *table.rows]
    widths = [max(len(line[i]) for line in lines) for i in range(len(table.columns))]
    for line in lines:
        cells = (cell.ljust(width) for cell, width in zip(line, widths, strict=True))
        print("  " + "  ".join(cells).rstrip(), file=out)


def _rich(table: Table, out: TextIO) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table as RichTable
    from rich.text import Text

    heads = any(table.columns)
    shown = RichTable(
        title=table.title, title_justify="left", box=box.SIMPLE_HEAD if heads else box.SIMPLE,
        show_header=heads,
    )  # fmt: skip
    for column in table.columns:
        shown.add_column(Text(column), overflow="fold")
    for row in table.rows:
        shown.add_row(*(Text(cell) for cell in row))
    Console(file=out).print(shown)
