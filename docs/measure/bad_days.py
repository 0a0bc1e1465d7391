"""The studies of docs/robustness.md: estimates of the best network on a long and on bad days."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from carried_batch import estimates
from faults import COUNT, FAULTS, FIRST, LENGTH, PERIOD, SAMPLES, drifting, faulty, mounted

from sensor.channels import CHANNEL_NAMES, SAMPLE_RATE_HZ
from sensor.conditions import Measurement
from sensor.dataset import Run, read_runs
from sensor.estimators import make
from sensor.evaluation import WARM_UP, measured_channels
from sensor.features import WHEEL_SPEEDS
from sensor.metrics import WIDTH, rms

Array = npt.NDArray[np.float64]

WINDOW = 20  # samples over which an error is pooled, 0.2 s
BACK = 1.5  # an error of this many times the usual one counts as recovered
SLIP_TIME = 5  # s after a slip that are looked at
FIVE_MINUTES = 300 * SAMPLE_RATE_HZ
DRIFT = (0.02, float(np.radians(0.02)))  # per ten minutes: m/s2 and rad/s
RADIUS_DRIFT = 0.003  # in the hour
SLIPPING = 0.1  # ratio of slip speed to driving speed (at least 2 m/s)
START = 4000  # samples of a drive from a fresh start
ADAPTED = ((0.5, 1), (1, 2), (2, 4), (4, 8), (8, 16), (16, 40))  # s after the start
_VX = CHANNEL_NAMES.index("Car.vx")


def covered(error: Array, deviation: Array) -> float:
    """Share [%] of errors within the 90 % band of the predicted deviation."""
    return float(100.0 * np.mean(np.abs(error) <= WIDTH * deviation))


@dataclass(frozen=True)
class Hour:
    """By five minutes: RMSE and mean error [m/s] (parts,), share covered [%]; `fresh`: RMSE of the
    same drive without drift, from a fresh start every five minutes; `truth` rms [m/s].
    """

    rmse: Array
    mean: Array
    coverage: Array
    fresh: Array
    truth: Array


def hour(data: Path) -> Hour:
    """Play the parts one after the other without a reset, the sensors drifting."""
    # passive and switching dampers in turn, or a difference between them would look like a drift
    runs = sorted(read_runs(data, ["part_*"]), key=lambda run: run.name.rsplit("_", 1)[1])
    sources = [np.vstack([getattr(run, name) for run in runs]) for name in ("channels", "stage")]
    commands = np.vstack([run.commands for run in runs]).astype(np.float64)
    truth = np.vstack([run.truth for run in runs]).astype(np.float64)
    measured = Measurement("production", 1).apply(*sources)
    parts = len(truth) // FIVE_MINUTES
    cut = [slice(k * FIVE_MINUTES, (k + 1) * FIVE_MINUTES) for k in range(parts)]
    fresh = [estimates("production", [(measured[one], commands[one])])[0][0] for one in cut]
    drifted = drifting(measured, DRIFT, RADIUS_DRIFT)
    found = estimates("production", [(drifted, commands)])
    error, deviation = found[0][0] - truth, found[1][0]
    used = [slice(one.start + WARM_UP, one.stop) for one in cut]
    return Hour(
        np.array([rms(error[one]) for one in used]),
        np.array([error[one].mean() for one in used]),
        np.array([covered(error[one], deviation[one]) for one in used]),
        np.array([rms((e - truth[one])[WARM_UP:]) for e, one in zip(fresh, cut, strict=True)]),
        np.array([rms(truth[one]) for one in used]),
    )


def trend(values: Array) -> tuple[float, float]:
    """Slope of values at equal steps over the whole length, and its standard error."""
    place = np.linspace(0.0, 1.0, len(values))
    (slope, _), covariance = np.polyfit(place, values, 1, cov=True)
    return float(slope), float(np.sqrt(covariance[0, 0]))


@dataclass(frozen=True)
class Fault:
    """Error of the network with a faulty channel [m/s]: rms without the fault (`before`, on the
    same samples) and with it; `after`: rms in the five seconds behind it; `recovery` [s], infinite
    if it takes longer than the study's 15 s; share covered [%] and growth of the predicted
    deviation (ratio) during it; `course`: rms in windows of 0.2 s from 1 s before its beginning on,
    with and without it.
    """

    channel: str
    fault: str
    before: float
    during: float
    after: float
    recovery: float
    coverage: float
    growth: float
    course: Array


def faults(run: Run, condition: str) -> list[Fault]:
    """Return every fault of every channel in a recorded run."""
    measured = measured_channels(run, condition)[:SAMPLES]
    commands = run.commands[:SAMPLES].astype(np.float64)
    truth = run.truth[:SAMPLES].astype(np.float64)
    usual, spread = (part[0] for part in estimates(condition, [(measured, commands)]))
    found = []
    for name in FAULTS:
        bad = [(faulty(measured, row, name), commands) for row in range(len(CHANNEL_NAMES))]
        for row, (velocity, deviation) in enumerate(zip(*estimates(condition, bad), strict=True)):
            errors = _events(velocity - truth), _events(usual - truth)
            spreads = _events(deviation), _events(spread)
            found.append(_fault(CHANNEL_NAMES[row], name, errors, spreads))
    return found


def _events(values: Array) -> Array:
    """Cut (samples, 4) into what begins 1 s before each fault: (faults, samples, 4)."""
    begin = FIRST - SAMPLE_RATE_HZ
    return values[begin : begin + COUNT * PERIOD].reshape(COUNT, PERIOD, -1)


def _fault(
    channel: str, name: str, errors: tuple[Array, Array], spreads: tuple[Array, Array]
) -> Fault:
    begin = SAMPLE_RATE_HZ
    during, after = slice(begin, begin + LENGTH), slice(begin + LENGTH, begin + 2 * LENGTH)
    courses = np.stack([windowed(error) for error in errors])
    return Fault(
        channel, name,
        rms(errors[1][:, during]), rms(errors[0][:, during]), rms(errors[0][:, after]),
        recovery(courses[:, (begin + LENGTH) // WINDOW :]),
        covered(errors[0][:, during], spreads[0][:, during]),
        rms(spreads[0][:, during]) / rms(spreads[1][:, during]),
        courses,
    )  # fmt: skip


def windowed(error: Array) -> Array:
    """Rms in windows of 0.2 s of errors (events, samples, 4), events and wheels pooled."""
    events = len(error)
    return np.sqrt(np.square(error).reshape(events, -1, WINDOW, 4).mean(axis=(0, 2, 3)))


def recovery(courses: Array) -> float:
    """Time [s] after which the error, (2, windows) with and without fault, stays below 1.5 times
    the one without; infinite if it does not.
    """
    late = np.flatnonzero(courses[0] > BACK * courses[1])
    if not len(late):
        return 0.0
    if late[-1] == courses.shape[1] - 1:
        return float("inf")
    return float((late[-1] + 1) * WINDOW / SAMPLE_RATE_HZ)


@dataclass(frozen=True)
class Slip:
    """RMSE [m/s] of an estimator while a wheel slips, in the second after, and otherwise; share
    covered while slipping [%]; `course` (windows,): rms in windows of 0.2 s after a slip.
    """

    estimator: str
    condition: str
    share: float
    slipping: float
    after: float
    otherwise: float
    coverage: float | None
    course: Array


def slips(data: Path) -> list[Slip]:
    """Return carried state and linear filter on slippery roads without slip control."""
    runs = read_runs(data, ["slip_*"])
    return [
        _slip(runs, name, condition)
        for condition in ("ideal", "production")
        for name in ("carried", "fir_residual_w64")
    ]


def _slip(runs: Sequence[Run], name: str, condition: str) -> Slip:
    errors, spreads, masks, ages = [], [], [], []
    for run in runs:
        measured, commands = measured_channels(run, condition), run.commands.astype(np.float64)
        if name == "carried":
            velocity, spread = (part[0] for part in estimates(condition, [(measured, commands)]))
        else:
            velocity = make(name, condition).apply(measured, commands)  # type: ignore[arg-type]
            spread = np.full_like(velocity, np.nan)
        mask, age = since_slip(run.channels.astype(np.float64))
        errors.append((velocity - run.truth)[WARM_UP:])
        spreads.append(spread[WARM_UP:])
        masks.append(mask[WARM_UP:])
        ages.append(age[WARM_UP:])
    error, spread = np.vstack(errors), np.vstack(spreads)
    slipping, age = np.concatenate(masks), np.concatenate(ages)
    free = ~slipping & (age >= SLIP_TIME * SAMPLE_RATE_HZ)
    after = ~slipping & (age < SAMPLE_RATE_HZ)
    course = [
        rms(error[~slipping & (age >= first) & (age < first + WINDOW)])
        for first in range(0, SLIP_TIME * SAMPLE_RATE_HZ, WINDOW)
    ]
    share = None if np.isnan(spread).all() else covered(error[slipping], spread[slipping])
    parts = (rms(error[slipping]), rms(error[after]), rms(error[free]))
    return Slip(name, condition, 100.0 * slipping.mean(), *parts, share, np.array(course))


def since_slip(channels: Array) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.int64]]:
    """Return whether a wheel spins or locks, and the samples since one did, (samples,) each."""
    speed = np.maximum(channels[:, _VX], 2.0)[:, np.newaxis]
    slipping = (np.abs(channels[:, WHEEL_SPEEDS] - channels[:, [_VX]]) > SLIPPING * speed).any(1)
    now = np.arange(len(slipping))
    last = np.maximum.accumulate(np.where(slipping, now, -(10**6)))
    return slipping, now - last - 1


@dataclass(frozen=True)
class Start:
    """RMSE [m/s] in the intervals of `ADAPTED` after a fresh start, and over all of them."""

    what: str
    rmse: Array
    overall: float
    coverage: float


def starts(runs: Sequence[Run]) -> list[Start]:
    """Fresh starts in production, without drawn errors first, then with one slow error at a time
    or another mount.
    """
    cut = [_part(run, 0) for run in runs]
    return [_start(what, cut, change) for what, change in slow_errors().items()]


def slow_errors() -> dict[str, dict[str, Any]]:
    """What is changed: gain (14,), offset (14,), place [m] and turn [rad] of the IMU."""
    cases: dict[str, dict[str, Any]] = {"nothing: noise, steps and latency alone": {}}
    for wheel, row in zip(("front left", "rear right"), WHEEL_SPEEDS[::3], strict=True):
        for percent in (1, -1):
            cases[f"{wheel} tyre {percent:+d} %"] = {"gain": {row: 1 + percent / 100}}
    degree = float(np.radians(1.0))
    cases["roll rate +1 deg/s"] = {"offset": {3: degree}}
    cases["pitch rate +1 deg/s"] = {"offset": {4: degree}}
    cases["yaw rate +1 deg/s"] = {"offset": {5: degree}}
    cases["a_z +0.5 m/s2"] = {"offset": {2: 0.5}}
    cases["all rates +1 deg/s, accelerations +0.16 m/s2"] = {
        "offset": {0: 0.16, 1: 0.16, 2: 0.16, 3: degree, 4: degree, 5: degree}
    }
    for metres in (0.1, 0.3, 0.6):
        cases[f"IMU {metres} m further ahead"] = {"place": (metres, 0.0, 0.0)}
    for metres in (0.3, 0.6):
        cases[f"IMU {metres} m to the left"] = {"place": (0.0, metres, 0.0)}
    for degrees in (0.5, 1.0, 2.0):
        cases[f"IMU turned by {degrees} deg about each axis"] = {"turn": np.radians(degrees)}
    return cases


def _start(what: str, runs: Sequence[Run], change: dict[str, Any]) -> Start:
    inputs, truth = [], []
    for number, run in enumerate(runs):
        measurement = Measurement("production", number)
        measurement.gain[:], measurement.bias[:] = 1.0, 0.0
        for row, gain in change.get("gain", {}).items():
            measurement.gain[row] = gain
        measurement.gain[_VX] = measurement.gain[WHEEL_SPEEDS].mean()
        for row, offset in change.get("offset", {}).items():
            measurement.bias[row] = offset
        stage = mounted(run.stage, change.get("place", (0, 0, 0)), change.get("turn", 0.0))
        measured = measurement.apply(run.channels, stage.astype(np.float32))
        inputs.append((measured, run.commands.astype(np.float64)))
        truth.append(run.truth)
    velocity, spread = estimates("production", inputs)
    error = velocity - np.stack(truth)
    parts = [slice(int(a * SAMPLE_RATE_HZ), int(b * SAMPLE_RATE_HZ)) for a, b in ADAPTED]
    all_of_it = slice(parts[0].start, None)
    return Start(
        what,
        np.array([rms(error[:, part]) for part in parts]),
        rms(error[:, all_of_it]),
        covered(error[:, all_of_it], spread[:, all_of_it]),
    )


def _part(run: Run, first: int) -> Run:
    part = slice(first, first + START)
    names = ("channels", "stage", "commands", "truth", "road")
    return Run(run.name, *(getattr(run, name)[part] for name in names))
