"""The command `cosim sensor-node`; heavy packages are imported where they are used."""

from __future__ import annotations

import json
from pathlib import Path

import click

from cosim.exit_codes import failures_as_exit_codes, one_thread


@click.command("sensor-node")
@click.option(
    "--interface",
    metavar="NAME",
    default="udp_multicast",
    show_default=True,
    help="Interface of python-can: udp_multicast, socketcan, pcan, vector and others.",
)
@click.option("--channel", metavar="C", help="Channel of the interface, such as can0.")
@click.option(
    "--option",
    "options",
    metavar="NAME=VALUE",
    multiple=True,
    help="What else the interface is given, such as bitrate=500000; may be repeated.",
)
@click.option("--estimator", metavar="NAME", help="A shipped estimator; the default one if none.")
@click.option(
    "--network",
    metavar="FILE.onnx",
    type=click.Path(path_type=Path),
    help="Instead of an estimator, a network.",
)
@click.option(
    "--fmu",
    metavar="FILE.fmu",
    type=click.Path(path_type=Path),
    help="Instead of an estimator, a sensor FMU.",
)
@click.option(
    "--condition",
    type=click.Choice(["ideal", "production"]),
    default="ideal",
    show_default=True,
    help="Measurement condition that the estimator is made for.",
)
@click.option(
    "--patience",
    metavar="MS",
    default=20.0,
    show_default=True,
    type=click.FloatRange(min=0, min_open=True),
    help="How long a sample's other frames are waited for before it is estimated without them.",
)
@click.option(
    "--runs", metavar="N", type=click.IntRange(1), help="End after N runs; never by default."
)
@click.option(
    "--idle",
    metavar="S",
    type=click.FloatRange(min=0, min_open=True),
    help="End after S seconds without a sample; never by default.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the figures as JSON on stdout.")
def sensor_node(
    interface: str,
    channel: str | None,
    options: tuple[str, ...],
    estimator: str | None,
    network: Path | None,
    fmu: Path | None,
    condition: str,
    patience: float,
    runs: int | None,
    idle: float | None,
    as_json: bool,
) -> None:
    """Run the virtual sensor as a node on a CAN bus, until Ctrl-C.

    It takes the channels from the bus, estimates, and answers with estimates, sample by sample; a
    scenario with `sensor.bus` is the other end.
    """
    one_thread()
    with failures_as_exit_codes():
        from cosim.bus import command
        from cosim.bus.node import Ending
        from cosim.bus.transport import Address

        number = int(channel) if channel is not None and channel.isdecimal() else channel
        address = Address(interface, number, command.options_of(options))
        choice = command.choice_of(estimator, network, fmu, condition)
        figures = command.run(choice, address, patience, Ending(runs, idle))
    if as_json:
        click.echo(json.dumps(figures, indent=2))
