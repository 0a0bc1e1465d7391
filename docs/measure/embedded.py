"""The C sensor on an emulated Cortex-M7: `make embedded`. Writes docs/embedded.md."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np
import numpy.typing as npt
import pandas as pd
from evaluated import ROOT
from markdown_tables import fill, table

from sensor.carried.runtime import CarriedSensor
from sensor.channels import CHANNELS, COMMANDS, SAMPLE_RATE_HZ
from sensor.packed import PackedNetwork, read_network
from sensor.runtime import OnnxSensor

sys.path.insert(0, str(ROOT / "fmu"))
import firmware
from toolchain import BuildError

PAGE = ROOT / "docs" / "embedded.md"
MODELS = ROOT / "sensor" / "models"
NETWORKS = {
    "carried state, production": "carried_production",
    "carried state, ideal": "carried_ideal",
    "the paper's, W = 19": "bilstm_w19_ideal",
}
SCENARIO = ("scenarios/paper/hockenheim_normal.yaml", "--set", "road.surface=A")
SECONDS = 1.0
LIMIT = 1e-5  # m/s
LIMIT_FAILED = 1  # exit code: a scenario cut short misses its limits

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Row:
    """One network on the board; `difference` [m/s] from ONNX Runtime, `instructions` a sample."""

    network: PackedNetwork
    built: firmware.Firmware
    difference: float
    instructions: float
    stack: int


def recorded(folder: Path) -> Array:
    """Return samples (n, 18) of the first seconds of a run."""
    command = [sys.executable, "-m", "cosim", "run", *SCENARIO, "--duration", str(SECONDS)]
    done = subprocess.run(
        [*command, "--output-dir", str(folder)], cwd=ROOT, capture_output=True, text=True
    )
    if done.returncode not in (0, LIMIT_FAILED):
        sys.exit(done.stderr)
    signals = pd.read_csv(folder / "signals.csv")
    names = {column.split(" [")[0]: column for column in signals.columns}
    columns = [names[channel.name] for channel in (*CHANNELS, *COMMANDS)]
    return signals[columns].to_numpy(dtype=np.float64)


def by_onnx_runtime(path: Path, samples: Array) -> Array:
    """Return estimates and deviations (n, 8) [m/s], NaN where they do not count."""
    channels, commands = samples[:, : len(CHANNELS)], samples[:, len(CHANNELS) :]
    if read_network(path).kind == "carried":
        return np.hstack(CarriedSensor(path).apply_with_deviation(channels, commands))
    estimates = OnnxSensor(path).apply(channels, commands)
    return np.hstack([estimates, 0.0 * estimates])


def measured(path: Path, samples: Array, folder: Path) -> Row:
    """Run one network on the board. Raises BuildError if it is not what ONNX Runtime gives."""
    network = read_network(path)
    built = firmware.build(network, samples, folder)
    answers = firmware.run(built)
    got = np.hstack([answers.estimates, answers.deviations])
    wanted = by_onnx_runtime(path, samples)
    if not np.array_equal(answers.counts, ~np.isnan(wanted).any(axis=1)):
        raise BuildError(f"{path.name}: other samples count on the board than in ONNX Runtime.")
    difference = float(np.abs(got - wanted)[answers.counts].max())
    if not difference <= LIMIT:
        raise BuildError(f"{path.name}: the board is {difference:.2g} m/s off ONNX Runtime.")
    instructions = float(np.median(answers.instructions[answers.counts]))
    return Row(network, built, difference, instructions, answers.stack)


def cells(name: str, row: Row) -> list[str]:
    """Return a row of the table."""
    b = row.built
    return [
        f"{name}, {row.network.units} units",
        f"{row.difference:.1e}",
        f"{row.instructions / 1e3:.0f}",
        f"{b.code / 1024:.1f} + {b.network / 1024:.0f}",
        f"{b.memory / 1024:.1f} + {row.stack / 1024:.1f}",
    ]


@click.command(help=__doc__)
def main() -> None:
    """Build, run, compare, write the page."""
    with tempfile.TemporaryDirectory() as name:
        samples = recorded(Path(name) / "run")
        try:
            rows = {
                title: measured(MODELS / f"{stem}.onnx", samples, Path(name) / stem)
                for title, stem in NETWORKS.items()
            }
        except BuildError as error:
            sys.exit(str(error))
    head = ["network", "difference, m/s", "1000 instructions a sample", "flash, kB: code + network",
            "RAM, kB: memory + stack"]  # fmt: skip
    budget = ", ".join(
        f"{SAMPLE_RATE_HZ * row.instructions / 1e6:.0f} MHz ({title})"
        for title, row in rows.items()
    )
    values = {
        "table": table(head, [cells(title, row) for title, row in rows.items()]),
        "seconds": f"{SECONDS:g}",
        "limit": f"{LIMIT:g}",
        "budget": budget,
    }
    fill(PAGE, values)


if __name__ == "__main__":
    main()
