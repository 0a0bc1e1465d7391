"""The command line; heavy packages are imported where they are used, so that `--help` is quick.

Results for programs go to stdout (`--json`), words for people to stderr. Exit codes: 0 fine, 1 a
limit failed, 2 wrong usage or bad input, 3 an FMU, a network or a bus failed, 130 interrupted; of
several scenarios the highest.
"""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cosim.exit_codes import cores, failures_as_exit_codes, one_thread
from cosim.sensor_cli import sensor
from cosim.sensor_node_cli import sensor_node

if TYPE_CHECKING:
    from cosim.isolation import Death


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="suspension-cosim", prog_name="cosim")
def main() -> None:
    """Drive a vehicle FMU over a road and compare a virtual suspension sensor with the truth."""


timeout_option = click.option(
    "--timeout",
    metavar="S",
    default=60.0,
    show_default=True,
    type=click.FloatRange(min=0, min_open=True),
    help="Wall time in s without a new sample after which a run counts as hanging.",
)


class RealTimeCommand(click.Command):
    """A command whose `--real-time` takes a factor after an equals sign only: what follows it is
    the next argument.
    """

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse as ever, a bare --real-time as a factor of 1."""
        return super().parse_args(
            ctx, ["--real-time=1" if word == "--real-time" else word for word in args]
        )


@main.command(cls=RealTimeCommand)
@click.argument("scenarios", metavar="SCENARIO...", nargs=-1, required=True)
@click.option(
    "--json",
    "as_json",
    is_flag=True,
    help="Print the metrics as JSON on stdout; a list for several scenarios or a folder.",
)
@click.option("--duration", metavar="S", help="Simulate S seconds, whatever the scenario says.")
@click.option(
    "--output-dir",
    metavar="DIR",
    type=click.Path(path_type=Path),
    help="Where the results go; results/SCENARIO by default, DIR/SCENARIO for several.",
)
@click.option(
    "--set",
    "overrides",
    metavar="KEY=VALUE",
    multiple=True,
    help="Override a field of the scenario, of each where there are several; may be repeated.",
)
@click.option(
    "--jobs",
    metavar="N",
    type=click.IntRange(1),
    help="Run up to N scenarios at the same time, as many as there are cores by default.",
)
@timeout_option
@click.option(
    "--real-time",
    metavar="[=FACTOR]",
    help="Go by the clock, FACTOR simulated seconds in one of its seconds, 1 by default.",
)
def run(
    scenarios: tuple[str, ...],
    as_json: bool,
    duration: str | None,
    output_dir: Path | None,
    overrides: tuple[str, ...],
    jobs: int | None,
    timeout: float,
    real_time: str | None,
) -> None:
    """Run each SCENARIO, a YAML file or a folder of them, and write the results.

    Fields are overridden by their dotted path, items of a list by their number from 0:
    --set driver.style=normal, --set controllers.0.kind=passive.
    """
    labelled = [(text, f"--set {text}") for text in overrides]
    if duration is not None:
        labelled.append((f"duration={duration}", f"--duration {duration}"))
    if real_time is not None:
        labelled.append((f"real_time.factor={real_time}", f"--real-time={real_time}"))
    one_thread()
    with failures_as_exit_codes():
        if len(scenarios) == 1 and not Path(scenarios[0]).is_dir():
            target = output_dir or Path("results") / Path(scenarios[0]).stem
            code = _run_one(scenarios[0], labelled, target, as_json, timeout)
        else:
            paths = [Path(name) for name in scenarios]
            results = output_dir or Path("results")
            code = _run_several(paths, labelled, results, as_json, jobs or cores(), timeout)
    sys.exit(code)


@main.command("test")
@click.argument(
    "paths", metavar="PATH...", nargs=-1, required=True, type=click.Path(path_type=Path)
)
@click.option(
    "--junitxml",
    "junit",
    metavar="FILE",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Write the verdicts as JUnit XML, the figures as properties.",
)
@click.option("--accept", is_flag=True, help="Make what comes out now the goldens.")
@click.option(
    "--output-dir",
    metavar="DIR",
    default="results",
    show_default=True,
    type=click.Path(path_type=Path),
    help="Where the results go, to DIR/SCENARIO each.",
)
@click.option(
    "--jobs",
    metavar="N",
    type=click.IntRange(1),
    help="Run up to N at the same time, as many as there are cores by default.",
)
@timeout_option
@click.option("--json", "as_json", is_flag=True, help="Print a list of the metrics as JSON.")
def test_scenarios(
    paths: tuple[Path, ...],
    junit: Path | None,
    accept: bool,
    output_dir: Path,
    jobs: int | None,
    timeout: float,
    as_json: bool,
) -> None:
    """Test scenarios by their limits and goldens, each PATH a YAML file or a folder of them.

    Each run has a process of its own: a crash or a hang of an FMU is a failed test, and what was
    recorded until then is on disk. Exit code 0 if all passed, 1 if one failed, 2 for bad input.
    """
    one_thread()
    with failures_as_exit_codes():
        from cosim.regression.command import Options
        from cosim.regression.command import run as run_tests

        options = Options(output_dir, jobs or cores(), timeout, accept, junit, as_json)
        code = run_tests(paths, options)
    sys.exit(code)


@main.command()
@click.argument("fmus", metavar="FMU...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--json", "as_json", is_flag=True, help="Print the reports as JSON on stdout.")
@click.option("--static", is_flag=True, help="Only read the FMU; do not run it.")
@click.option(
    "--timeout",
    metavar="S",
    default=20.0,
    show_default=True,
    type=click.FloatRange(min=0, min_open=True),
    help="Wall time in s that one call of an FMU may take.",
)
def check(fmus: tuple[Path, ...], as_json: bool, static: bool, timeout: float) -> None:
    """Find the defects of co-simulation FMUs, FMI 2.0 or 3.0, in their files and while they run.

    Each FMU runs in processes of its own, so that a crash or a hang becomes a finding.
    """
    with failures_as_exit_codes():
        from cosim.check.command import run as run_checks

        code = run_checks(fmus, as_json, static, timeout)
    sys.exit(code)


@main.command()
@click.argument("network", metavar="MODEL.onnx", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--out",
    metavar="FILE.fmu",
    required=True,
    type=click.Path(path_type=Path),
    help="Where the FMU goes.",
)
@click.option(
    "--fmi",
    default="3",
    show_default=True,
    type=click.Choice(["2", "3"]),
    help="Version of FMI.",
)
@click.option(
    "--platform",
    "platforms",
    metavar="P",
    multiple=True,
    help="A platform beside this one, such as x86_64-windows, or all; may be repeated. "
    "'make cross' compiles for them.",
)
def pack(network: Path, out: Path, fmi: str, platforms: tuple[str, ...]) -> None:
    """Write a trained network as an FMU that needs no other software.

    The FMU is run beside the network before it is written.
    """
    one_thread()
    with failures_as_exit_codes():
        from cosim.pack.command import run as run_pack

        run_pack(network, out, int(fmi), platforms)


@main.command()
@click.argument("path", type=click.Path(path_type=Path))
@click.option("--json", "as_json", is_flag=True, help="Print the facts as JSON on stdout.")
@click.option("--all", "every", is_flag=True, help="Show long lists of variables in full.")
def inspect(path: Path, as_json: bool, every: bool) -> None:
    """Show what is inside PATH: an FMU, an ONNX network, a scenario or an OpenCRG road."""
    with failures_as_exit_codes():
        from cosim.inspect.command import run as run_inspection

        run_inspection(path, as_json, every)


@main.command()
@click.argument("runs", metavar="RUN...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--output",
    metavar="FILE.html",
    default="results/compare.html",
    show_default=True,
    type=click.Path(path_type=Path, dir_okay=False),
    help="Where the page goes.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the figures as JSON on stdout.")
def compare(runs: tuple[Path, ...], output: Path, as_json: bool) -> None:
    """Put runs side by side: a table, and a page with their spectra and signals.

    RUN is a folder that 'cosim run' has written, for all runs in it, or that of a single run below.
    """
    with failures_as_exit_codes():
        from cosim.comparison.command import run as run_comparison

        run_comparison(runs, output, as_json, "cosim " + shlex.join(sys.argv[1:]))


@main.command("export-ssp")
@click.argument("scenario")
@click.option(
    "-o",
    "--out",
    metavar="FILE.ssp",
    required=True,
    type=click.Path(path_type=Path, dir_okay=False),
    help="Where the package goes.",
)
@click.option(
    "--controller",
    metavar="NAME",
    help="Whose damper commands are recorded; the scenario's first by default.",
)
@click.option(
    "--components-only",
    is_flag=True,
    help="No connectors of the system as a whole, which libcosim and Ecos cannot read.",
)
@click.option(
    "--set",
    "overrides",
    metavar="KEY=VALUE",
    multiple=True,
    help="Override a field of the scenario; may be repeated.",
)
def export_ssp(
    scenario: str,
    out: Path,
    controller: str | None,
    components_only: bool,
    overrides: tuple[str, ...],
) -> None:
    """Write the wiring of SCENARIO as an SSP 1.0 package: vehicle and sensor FMU, their start
    values and connections.

    Driver and controller are no FMUs: the package's inputs are what they command, recorded in a run
    of the scenario.
    """
    one_thread()
    with failures_as_exit_codes():
        from cosim.ssp.command import run as run_export

        settings = [(text, f"--set {text}") for text in overrides]
        run_export(scenario, out, controller, settings, components_only)


def _run_one(
    scenario: str,
    overrides: Sequence[tuple[str, str]],
    target: Path,
    as_json: bool,
    timeout: float,
) -> int:
    from cosim.guardian import guarded

    def run(ending: Callable[[], None]) -> int:
        from cosim import show
        from cosim.scenario.load import load_labelled

        settings = load_labelled(scenario, overrides)

        from cosim.run import execute
        from cosim.watchdog import Watchdog

        command = "cosim " + shlex.join(sys.argv[1:])
        with Watchdog(timeout, target, ending) as watchdog, show.progress() as progress:
            outcome = execute(settings, target, progress, watchdog.assemble, command)
        show.outcome(outcome)
        if as_json:
            _print_json(outcome.metrics)
        return outcome.exit_code

    def bury(death: Death) -> None:
        from cosim.batch.buried import bury_run_under_way
        from cosim.scenario.load import load_labelled

        words = bury_run_under_way(load_labelled(scenario, overrides), target, death)
        click.echo(f"error: {words}", err=True)

    return guarded(run, bury)


def _run_several(
    paths: Sequence[Path],
    overrides: Sequence[tuple[str, str]],
    results: Path,
    as_json: bool,
    processes: int,
    timeout: float,
) -> int:
    from cosim import show
    from cosim.batch import find_scenarios, plan, run_all

    files, others = find_scenarios(paths)
    for file in others:
        click.echo(f"note: {file} has no road, so it is no scenario; left out", err=True)
    jobs = plan(files, results, overrides)
    ended, were_run = run_all(jobs, processes, show.counter(len(jobs)), timeout)
    if were_run:
        show.batch(ended)
    else:
        show.problems(ended)
    if as_json:
        _print_json([one.as_dict() for one in ended])
    return max(one.exit_code for one in ended)


def _print_json(value: object) -> None:
    click.echo(json.dumps(value, indent=2, ensure_ascii=False))


main.add_command(sensor)
main.add_command(sensor_node)
