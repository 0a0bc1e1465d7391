"""The sensor FMUs' own behaviour: when they sample, what they say, channels without a value."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from fractions import Fraction
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
import shipped_fmus as fmus
from fmu_face import OK, instances, refused
from sensor_rig import PERIOD, Sensor, expected, same, signal

from sensor.carried.runtime import LARGEST
from sensor.channels import CHANNELS, COMMANDS, OUTPUTS, PASSIVE_COMMAND

Array = npt.NDArray[np.float64]
Make = Callable[..., Sensor]
STEPS = (Fraction(1, 1000), Fraction(7, 1000), PERIOD, Fraction(20, 1000), Fraction(1, 128),
         Fraction(1, 300))  # fmt: skip
MISSED = "Sensor.MissedSamples"


# One model of C serves both FMI versions; test_fmu_*.py hold both against the standards.
@pytest.fixture(
    scope="module",
    params=[fmus.Shipped("small windowed", 2), fmus.Shipped("small carried", 3)],
    ids=str,
)
def shipped(request: pytest.FixtureRequest) -> fmus.Shipped:
    return request.param


@pytest.fixture(scope="module")
def folder(shipped: fmus.Shipped) -> Iterator[Path]:
    with fmus.unzipped(shipped, "a b%20 Fahrwerk-Prüfstand #1 道路 ") as path:
        yield path


@pytest.fixture
def make(folder: Path) -> Iterator[Make]:
    with instances(Sensor, folder) as new:
        yield new


@pytest.fixture
def network(shipped: fmus.Shipped) -> Path:
    return shipped.network


# ---------------------------------------------------------------- sampling


@pytest.mark.parametrize("step", STEPS, ids=lambda s: f"{float(1000 * s):.4g}ms")
def test_it_samples_by_its_own_clock(make: Make, network: Path, step: Fraction) -> None:
    """Whatever the master's step: samples at 0, 10 ms, 20 ms, read from what is held then."""
    count = min(math.ceil(Fraction(3, 2) / step), 600)
    channels, commands = signal(count)
    wanted = expected(network, step, channels, commands)
    same(make().start().follow(float(step), channels, commands), wanted)
    assert (wanted.missed[-1] > 0) == (step > PERIOD)
    if count * step > 1:
        assert wanted.valid[-1]
        assert np.ptp(wanted.estimates[wanted.valid]) > 0.01


def test_between_samples_the_outputs_stay(make: Make) -> None:
    channels, commands = signal(1000)
    found = make().start().follow(0.001, channels, commands)
    changes = np.flatnonzero(np.any(np.diff(found.estimates, axis=0) != 0.0, axis=1)) + 1
    assert len(changes) > 20
    assert set(changes % 10) == {0}  # the step that begins at a sample ends with its estimate


def test_time_that_a_master_adds_up_makes_no_drift(make: Make) -> None:
    """Twenty seconds of 1 ms, summed in floating point."""
    channels, commands = signal(200)
    counted, summed = make().start(), make().start()
    t = 0.0
    for k in range(20_000):
        if k % 10 in (0, 5):  # at a sample, and halfway to the next
            for face in (counted, summed):
                face.feed(channels[k % 200], commands[k % 200])
        counted.step(k, 0.001)
        summed.fmu.doStep(t, 0.001)
        t += 0.001
    assert t != 20.0
    assert counted.read() == summed.read()
    assert counted[MISSED] == 0.0


def test_another_start_time_shifts_the_samples(make: Make) -> None:
    here, later = make().start(), make()
    if later.version == 2:
        later.fmu.setupExperiment(startTime=1e6 + 0.0037)
        later.fmu.enterInitializationMode()
    else:
        later.fmu.enterInitializationMode(startTime=1e6 + 0.0037)
    later.fmu.exitInitializationMode()
    channels, commands = signal(200)
    t = 1e6 + 0.0037
    for k in range(200):
        for face in (here, later):
            face.feed(channels[k], commands[k])
        here.step(k, 0.007)
        later.fmu.doStep(t + 0.007 * k, 0.007)
        assert here.read() == later.read()


def test_steps_may_vary(make: Make, network: Path) -> None:
    """Steps between 0.1 and 25 ms, drawn at random; the oracle sees each sample's step."""
    random = np.random.default_rng(7)
    lengths = [Fraction(int(n), 10_000) for n in random.integers(1, 250, 100)]
    face, fine = make().start(), make().start()
    channels, commands = signal(100)
    begin, tick = Fraction(0), Fraction(1, 10_000)
    for k, length in enumerate(lengths):
        for one in (face, fine):
            one.feed(channels[k], commands[k])
        face.fmu.doStep(float(begin), float(length))
        for i in range(int(length / tick)):
            fine.fmu.doStep(float(begin + i * tick), float(tick))
        begin += length
        assert face.read()[:-1] == fine.read()[:-1]
    assert fine[MISSED] == 0.0
    assert face[MISSED] > 0.0


def test_missed_samples_are_said_once_and_counted(make: Make) -> None:
    face = make().start()
    face.feed(*(part[0] for part in signal(1)))
    for k in range(5):
        face.step(k, 0.03)
    said = [m for m in face.messages if m[1] == "logSampling"]
    assert len(said) == 1
    assert said[0][0] == OK
    assert "A step of 0.03 s has more than one sample of 0.01 s in it" in said[0][2]
    assert face[MISSED] == 10.0


def test_a_step_of_more_samples_than_can_be_taken_is_refused(make: Make) -> None:
    for step in (2e7, 1e300):
        face = make().start()
        said = refused(face, lambda h=step, f=face: f.fmu.doStep(0.0, h))
        assert f"A step of {step:g} s has" in said.replace("e+0", "e+0")
        face.fmu.reset()
        face.start().step(0, 0.01)


# ---------------------------------------------------------------- warm-up, missing channels


def test_before_the_first_sample_there_is_no_estimate(make: Make) -> None:
    face = make().start()
    assert face["Sensor.Valid"] is False
    assert set(face.read()) == {0.0}


def test_it_says_from_when_the_estimates_count(make: Make, shipped: fmus.Shipped) -> None:
    channels, commands = signal(80)
    face = make().start()
    found = face.follow(0.01, channels, commands)
    first = int(np.flatnonzero(found.valid)[0])
    assert found.valid[first:].all()
    assert first == (50 if shipped.carried else fmus.WINDOW - 1)
    said = [m[2] for m in face.messages if m[1] == "logChannels"]
    assert said == [f"The estimates count from t = {first / 100:g} s on."]


@pytest.mark.parametrize("gap", [1, 10, 11, 150])
@pytest.mark.parametrize("nothing", [math.nan, math.inf, -math.inf])
def test_a_channel_without_a_value_and_full_recovery(
    make: Make, shipped: fmus.Shipped, gap: int, nothing: float
) -> None:
    channels, commands = (part.copy() for part in signal(600))
    channels[100 : 100 + gap, 11] = nothing
    channels[100 + gap // 2, 3] = nothing
    face = make().start()
    found = face.follow(0.01, channels, commands)
    same(found, expected(shipped.network, PERIOD, channels, commands))
    np.testing.assert_array_equal(found.valid[100 : 100 + gap], False)
    assert np.isfinite(found.estimates).all()
    held = found.estimates[100 : 100 + gap]
    np.testing.assert_array_equal(held, np.broadcast_to(found.estimates[99], held.shape))
    assert found.valid[-1]
    undisturbed = make().start().follow(0.01, *signal(600))
    again = int(np.flatnonzero(found.valid[100 + gap :])[0])
    if shipped.carried:
        assert again == (0 if gap <= 10 else 199)
    else:
        assert again == fmus.WINDOW - 1
        assert (found.estimates[-1] == undisturbed.estimates[-1]).all()  # the window has forgotten


def test_a_trained_carried_state_forgets_a_gap() -> None:
    """Half a minute after a second without wheel speed the estimates are what they would be."""
    channels, commands = (part.copy() for part in signal(3300))
    channels[100:200, 9] = math.nan
    with fmus.unzipped(fmus.Shipped("carried", 3)) as path, instances(Sensor, path) as make:
        found = make().start().follow(0.01, channels, commands)
        undisturbed = make().start().follow(0.01, *signal(3300))
    apart = np.abs(found.estimates - undisturbed.estimates).max(axis=1)
    assert apart[200:500].max() > 0.01
    assert apart[-100:].max() < 1e-3


def test_the_log_names_each_channel_once_in_an_episode(make: Make) -> None:
    channels, commands = (part.copy() for part in signal(120))
    channels[60:65, 0] = math.nan
    channels[62:64, 7] = -math.inf
    channels[66:68, 0] = math.inf
    face = make().start()
    face.follow(0.01, channels, commands)
    said = [m for m in face.messages if m[1] == "logChannels" and "no estimate counts" in m[2]]
    assert {m[0] for m in said} == {OK}
    assert [m[2].partition(":")[0] for m in said] == [
        "Car.ax is nan at t = 0.6 s",
        "Car.SteerAngleFL is -inf at t = 0.62 s",
        "Car.ax is inf at t = 0.66 s",
    ]


def test_channels_missing_from_the_start(make: Make, network: Path) -> None:
    channels, commands = (part.copy() for part in signal(300))
    channels[:40, 6] = math.nan
    face = make().start()
    found = face.follow(0.01, channels, commands)
    same(found, expected(network, PERIOD, channels, commands))
    assert not found.valid[:40].any()
    assert found.valid[-1]


def test_a_command_that_is_not_finite_is_refused(make: Make) -> None:
    face = make().start()
    if not face.commanded:
        pytest.skip("the network knows no damper command")
    before = face[COMMANDS[1].name]
    message = refused(face, lambda: face.__setitem__(COMMANDS[1].name, math.nan))
    assert f"{COMMANDS[1].name} cannot be set to nan" in message
    assert face[COMMANDS[1].name] == before


def test_a_channel_beyond_its_range_acts_at_its_limit(make: Make) -> None:
    channels, commands = (part.copy() for part in signal(100))
    limited, beyond = make().start(), make().start()
    for k in range(100):
        limited.feed([*LARGEST[:3], *channels[k, 3:]], commands[k])
        for i in range(3):
            beyond.set_status(CHANNELS[i].name, 1e6 * (1 + k))
        for i in range(3, 14):
            beyond.set_status(CHANNELS[i].name, channels[k, i])
        for i, name in enumerate(c.name for c in COMMANDS):
            if beyond.commanded:
                beyond[name] = commands[k, i]
        limited.step(k, 0.01)
        beyond.step(k, 0.01)
        assert limited.read() == beyond.read()
    assert len([m for m in beyond.messages if "acts as" in m[2]]) == 3


# ---------------------------------------------------------------- what the description says


def test_variables_are_those_of_the_sensor(shipped: fmus.Shipped) -> None:
    known = fmus.variables(shipped)
    inputs = [n for n, v in known.items() if v.causality == "input"]
    carried = shipped.carried
    wanted = (*CHANNELS, *(COMMANDS if carried else ()))
    assert inputs == [channel.name for channel in wanted]
    assert [known[channel.name].unit for channel in wanted] == [c.unit for c in wanted]
    limits = [(float(known[c.name].min), float(known[c.name].max)) for c in CHANNELS]
    assert limits == [(-most, most) for most in LARGEST]
    outputs = [n for n, v in known.items() if v.causality == "output"]
    deviations = [f"VRel.Deviation.{o.name[-2:]}" for o in OUTPUTS] if carried else []
    velocities = [o.name for o in OUTPUTS]
    assert outputs == [*velocities, *deviations, MISSED, "Sensor.Valid"]
    assert not [n for n, v in known.items() if v.causality == "parameter"]
    starts = {float(known[c.name].start) for c in COMMANDS if carried}
    assert starts <= {PASSIVE_COMMAND}


def test_the_signs_are_said_as_the_vehicle_says_them(shipped: fmus.Shipped) -> None:
    """One signal, one description: what the vehicle puts out is what the sensor takes in."""
    car = fmus.variables(fmus.Shipped("vehicle", shipped.version))
    sensor = fmus.variables(shipped)
    for channel in CHANNELS:
        assert sensor[channel.name].description == car[channel.name].description
        assert sensor[channel.name].displayUnit == car[channel.name].displayUnit
