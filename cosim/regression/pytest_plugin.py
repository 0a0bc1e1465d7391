"""pytest collects scenarios as tests where it is asked to, by `pytest --cosim` or `cosim = true` in
its settings.

Without that the plugin only knows its options, so that it disturbs nobody who has the package
installed. Nothing heavy is imported before a scenario is collected.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from cosim.batch.job import Ended
    from cosim.batch.pool import Pool

_ENDINGS = (".yaml", ".yml")
_pool: pytest.StashKey[Pool] = pytest.StashKey()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the plugin's options."""
    group = parser.getgroup("cosim", "scenarios of the co-simulation")
    group.addoption(
        "--cosim", action="store_true", help="collect scenarios with limits or goldens as tests"
    )
    group.addoption(
        "--cosim-output-dir", metavar="DIR", type=Path, default=Path("results"),
        help="where the results of scenarios go, to DIR/PATH/SCENARIO each (default: results)",
    )  # fmt: skip
    group.addoption(
        "--cosim-timeout", metavar="S", type=float, default=60.0,
        help="wall time in s without a new sample after which a run hangs (default: 60)",
    )  # fmt: skip
    group.addoption(
        "--cosim-accept", action="store_true", help="make what comes out now the goldens"
    )
    parser.addini("cosim", "collect scenarios with limits or goldens as tests", "bool", False)


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> ScenarioFile | None:
    """Collect a scenario that has limits or goldens, or is named on the command line."""
    config = parent.config
    if file_path.suffix not in _ENDINGS or not (config.option.cosim or config.getini("cosim")):
        return None
    if not (parent.session.isinitpath(file_path) or _is_test(file_path)):
        return None
    return ScenarioFile.from_parent(parent, path=file_path)


def _is_test(file: Path) -> bool:
    """Whether a file among others is a scenario with limits or goldens."""
    if b"road:" not in file.read_bytes():  # which is quick where there is much other YAML
        return False
    from cosim.batch.plan import fields_of
    from cosim.regression.command import SECTIONS
    from cosim.results import RESOLVED

    fields = fields_of(file) or {}
    return (
        file.name != RESOLVED
        and "road" in fields
        and any(fields.get(section) for section in SECTIONS)
    )


def pytest_unconfigure(config: pytest.Config) -> None:
    """End the processes."""
    pool = config.stash.get(_pool, None)
    if pool is not None:
        pool.close()


class ScenarioFile(pytest.File):
    """A scenario file, which is one test."""

    def collect(self) -> Iterator[ScenarioItem]:
        """Yield the test."""
        yield ScenarioItem.from_parent(self, name="scenario")


class ScenarioItem(pytest.Item):
    """A scenario with all its runs; each has a process of its own."""

    def runtest(self) -> None:
        """Run it, keep its figures as properties; raises `ScenarioFailed`."""
        from cosim.regression.junit import figures_of

        ended = self._ended()
        for run in ended.runs:
            before = f"{run.label}." if len(ended.runs) > 1 else ""
            self.user_properties += [
                (before + k, value) for k, value in figures_of(ended, run.label)
            ]
        self.add_report_section("call", "cosim", _table(ended))
        if ended.exit_code:
            raise ScenarioFailed(ended)

    def _ended(self) -> Ended:
        from cosim.batch.job import Goldens, Job
        from cosim.batch.run_all import run_in

        option = self.config.option
        goldens: Goldens = "accept" if option.cosim_accept else "compare"
        job = Job(self.path, option.cosim_output_dir / self._below_root(), (), goldens)
        (ended,), _ = run_in(_processes(self.config), [job], timeout=option.cosim_timeout)
        return ended

    def _below_root(self) -> Path:
        """Return where the file is, without its ending: two may have the same name."""
        root = self.config.rootpath
        inside = self.path.is_relative_to(root)
        return (self.path.relative_to(root) if inside else Path(self.path.name)).with_suffix("")

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """Say what failed, without the way through this package."""
        if isinstance(excinfo.value, ScenarioFailed):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, int | None, str]:
        """Return file, line and name."""
        return self.path, None, f"scenario {self.path.stem}"


class ScenarioFailed(Exception):  # noqa: N818 - a verdict, not a mistake
    """A scenario failed; its words are those of all its failures."""

    def __init__(self, ended: Ended) -> None:
        from cosim.regression.show import failures

        super().__init__("\n".join((*failures(ended), f"results in {ended.job.output_dir}")))


def _processes(config: pytest.Config) -> Pool:
    """Return the processes of this session, started with its first scenario."""
    if _pool not in config.stash:
        from cosim.batch.pool import Pool
        from cosim.exit_codes import cores

        # Of several workers of pytest each has one; else runs of a scenario go side by side.
        config.stash[_pool] = Pool(1 if "PYTEST_XDIST_WORKER" in os.environ else cores())
    return config.stash[_pool]


def _table(ended: Ended) -> str:
    from cosim.regression.show import table
    from cosim.tables import plain

    return "\n".join((plain(table([ended])), *ended.notes, *ended.moved))
