"""The FMUs in masters that are not ours: the vehicle's results bit for bit, and its estimates.

The step is a power of two: libcosim counts nanoseconds and passes the difference of two
communication points as the step. With 10 ms that is 10 ms only to rounding, and so are the results.
"""

from __future__ import annotations

from pathlib import Path

import foreign_masters
import numpy as np
import numpy.typing as npt
import pytest
import shipped_fmus as fmus
from foreign_masters import Pair, Task
from vehicle_rig import INPUTS, cosine_bump, output_names, straight_road

from cosim.fmi import Description, Slave
from cosim.recorder import held
from cosim.vehicle import builtin_fmu
from sensor.channels import CHANNEL_NAMES, COMMANDS, OUTPUT_NAMES, PASSIVE_COMMAND
from sensor.estimators import open_network

Array = npt.NDArray[np.float64]

H = 1 / 128
STEPS = 512  # 4 s
START = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]  # of the inputs

PAIRS = [("libcosimpy", 2), ("ecospy", 2), ("ecospy", 3)]


def commands() -> Array:
    """Inputs of every step (STEPS, 8), all of them changing at every step."""
    t = H * np.arange(STEPS)
    pedal = np.sin(2 * t)
    dampers = [0.5 + 0.5 * np.sin((3 + i) * t + i) for i in range(4)]
    held = [np.sin(3 * t), pedal.clip(0, 1), 0.4 * (-pedal).clip(0, 1), 0.8 + 0.2 * np.cos(t)]
    return np.column_stack([*held, *dampers])


@pytest.fixture(scope="module")
def road(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("road") / "bump.crg"
    return straight_road(path, lambda s, v: cosine_bump(s, 5.0, 3.0, 0.06) + 0.005 * v)


def task(version: int, road: str, inputs: Array) -> Task:
    parameters: dict[str, float | str] = {"Road.File": road, "Init.Velocity": 12.0}
    fmu = Path(builtin_fmu(version))
    return Task(fmu, H, parameters, INPUTS, inputs.tolist(), output_names())


def ours(version: int, road: str, inputs: Array) -> Array:
    slave = Slave(Description(builtin_fmu(version)), INPUTS, output_names())
    slave.inputs[:] = START
    slave.initialise({"Road.File": road, "Init.Velocity": 12.0})
    rows = np.empty((len(inputs), len(output_names())))
    for k, values in enumerate(inputs):
        slave.inputs[:] = values
        slave.step(k, H)
        slave.read()
        rows[k] = slave.outputs
    slave.close()
    return rows


def to_the_ends(step: Array) -> Array:
    """Damper commands at 0 or 1."""
    ends = step[:64].copy()
    ends[:, 4:] = np.round(ends[:, 4:])
    return ends


def beyond_the_ends(step: Array) -> Array:
    """The same commands as a master sends them that knows no limits."""
    ends = to_the_ends(step)
    ends[:, 4:] += np.where(ends[:, 4:] > 0.5, 0.7, -3.0)
    return ends


@pytest.fixture(scope="module", params=PAIRS, ids=lambda pair: f"{pair[0]}-fmi{pair[1]}")
def driven(request: pytest.FixtureRequest, road: str) -> tuple[int, list[Array]]:
    """Four seconds, and half a second with commands beyond their range."""
    master, version = request.param
    inputs = (commands(), beyond_the_ends(commands()))
    rows = foreign_masters.run(master, [task(version, road, i) for i in inputs])
    return version, [np.array(r) for r in rows]


def test_four_seconds_over_a_bump(driven: tuple[int, list[Array]], road: str) -> None:
    version, (rows, _) = driven
    expected = ours(version, road, commands())
    assert np.ptp(expected[:, output_names().index("Car.CFL.q0")]) > 0.02
    np.testing.assert_array_equal(rows, expected)


def test_a_command_beyond_its_range_does_not_stop_a_master(
    driven: tuple[int, list[Array]], road: str
) -> None:
    """It gets a Warning and goes on with the limit."""
    version, (_, rows) = driven
    np.testing.assert_array_equal(rows, ours(version, road, to_the_ends(commands())))


# ---------------------------------------------------------------- the sensor beside the vehicle

STEP = 0.01  # as a user would take it
CHANNELS = tuple(CHANNEL_NAMES)
ESTIMATES = tuple(OUTPUT_NAMES)
DAMPERS = tuple(command.name for command in COMMANDS)
MASTERS = [("fmpy", 2), ("fmpy", 3), *PAIRS]


@pytest.mark.parametrize("model", fmus.KINDS)
@pytest.mark.parametrize(("master", "version"), MASTERS, ids=lambda value: str(value))
def test_vehicle_and_sensor_connected(master: str, version: int, model: str, road: str) -> None:
    """The estimate of the sample at t_k stands at the sensor's output at t_k+1, and is what the
    network says of the vehicle's channels at t_k.
    """
    inputs = commands()[:200]
    sensor = fmus.Shipped(model, version)
    own = DAMPERS if sensor.carried else ()
    pair = Pair(
        builtin_fmu(version), sensor.path, STEP, {"Road.File": road, "Init.Velocity": 12.0},
        INPUTS, own, np.hstack([inputs, inputs[:, 4 : 4 + len(own)]]).tolist(), CHANNELS, ESTIMATES,
    )  # fmt: skip
    found = np.array(foreign_masters.run_pair(master, pair))
    wanted = estimates(sensor.network, channels(version, road, inputs), inputs[:, 4:])
    counted = np.isfinite(wanted[:, 0])
    assert counted.sum() >= 150
    np.testing.assert_allclose(found[counted], wanted[counted], rtol=0.0, atol=1e-5)
    assert np.ptp(found[counted]) > 0.1


def channels(version: int, road: str, inputs: Array) -> Array:
    """The vehicle's channels at the beginning of each step (steps, 14)."""
    slave = Slave(Description(builtin_fmu(version)), INPUTS, CHANNELS)
    slave.inputs[:] = START
    slave.initialise({"Road.File": road, "Init.Velocity": 12.0})
    rows = np.empty((len(inputs), len(CHANNELS)))
    for k, values in enumerate(inputs):
        slave.read()
        rows[k] = slave.outputs
        slave.inputs[:] = values
        slave.step(k, STEP)
    slave.close()
    return rows


def estimates(network: Path, measured: Array, command: Array) -> Array:
    """The network's own estimates, with the command that was held until each sample."""
    return open_network(network).apply(measured, held(command, np.full(4, PASSIVE_COMMAND)))
