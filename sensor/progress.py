"""The progress display of a training: epochs done, of how many, and one line."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn


@contextmanager
def epochs(total: int) -> Iterator[Callable[[int, int, str], None]]:
    """Show a bar on stderr; what is yielded takes epochs done, their total, and the line."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed}/{task.total}"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True)) as progress:
        task = progress.add_task("first epoch", total=total)

        def tell(done: int, of: int, text: str) -> None:
            progress.update(task, completed=done, total=of, description=text)

        yield tell
