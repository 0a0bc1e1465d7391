"""What vertical motion does to the wheel speeds: each term's share, and what follows from them.

The residual of a wheel speed is what a rigid car on undeformed wheels would not show: the signal
less the body's own motion at the wheel, along the road and in pitch. Class B road, 50 km/h.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from gates import STUDIES, Study, at_least, at_most, gate
from scipy import signal
from validation_plots import log_bands, picture
from vehicle_linear import LinearCar, per_corner
from vehicle_rig import (
    CORNERS,
    GAS,
    STEER,
    Array,
    Record,
    Rig,
    cosine_bump,
    each,
    parameter,
    run,
    straight_road,
    straight_track,
)

from cosim.fmi import Value
from cosim.road import Iso8608, build_road

SECTION = "Wheel speeds"
SPEED = 50.0 / 3.6  # [m/s]
BAND = (0.5, 25.0)  # [Hz]
# each term, its source, and the start values that take it out
TERMS: dict[str, tuple[str, dict[str, Value]]] = {
    "rolling radius over load": (
        "MF-Tyre: BREFF, DREFF, FREFF (Pacejka, 3rd ed.)",
        {"Tire.LoadDependentRadius": False},
    ),
    "recession": (
        "design: 5 and 12 mm per 100 mm",
        each("Kin.Recession@", 0.0) | each("Kin.RecessionCurve@", 0.0),
    ),
    "knuckle pitch": (
        "25 % anti-dive and 35 % anti-lift, given the recession",
        each("Kin.KnucklePitch@", 0.0),
    ),
    "half-shaft torsion": (
        "design: 7 and 8 kN m/rad",
        {"PT.RigidShafts": True},
    ),
    "slip under drive torque": (
        "Magic Formula: slip stiffness over load; torque against drag",
        {"Tire.LoadDependentSlip": False},
    ),
    "bump steer and camber": (
        "design: 0.3, 0.2 and 1.5, 2.5 deg per 100 mm",
        {k: v for n in ("BumpSteer", "Camber", "CamberCurve")
         for k, v in each(f"Kin.{n}@", 0.0).items()},
    ),
}  # fmt: skip
FINE, COARSE = 0.002, 0.01  # communication steps of the study and of the channels [s]
MODES = {"heave": (1, 1, 1, 1), "pitch": (1, 1, -1, -1), "roll": (1, -1, 1, -1),
         "warp": (1, -1, -1, 1)}  # fmt: skip


@cache
def class_b(seconds: float) -> str:
    return str(build_road(straight_track(SPEED * seconds + 60.0), Iso8608("B", 5)))


def holding_gas(start: dict[str, Value]) -> float:
    """The pedal that gives the torque of the steady start."""
    with Rig(start) as rig:
        torque = sum(rig[f"PT.Motor{c}.Trq"] for c in CORNERS)
    motor_speed = parameter("PT.GearRatio") * SPEED / parameter("Wheel.KinematicRadius")
    available = min(parameter("PT.MotorTorque"), parameter("PT.MotorPower") / motor_speed)
    rear = parameter("PT.RearShare")
    return torque / (2.0 * (1.0 + (1.0 - rear) / rear) * available)


@cache
def ride(seconds: float, h: float, *out: str) -> Record:
    """Class B, straight on, speed held by a constant pedal; the terms `out` are taken out.

    The sensors' stage is on: IMU low-pass at 30 Hz, wheel-speed rings of 48 teeth.
    """
    start: dict[str, Value] = {
        "Init.Velocity": SPEED, "Road.File": class_b(seconds), "Damp.Passive": True,
        "Sensor.Imu.Cutoff": 30.0, "Sensor.WheelSpd.Teeth": 48.0,
    }  # fmt: skip
    for term in out:
        start |= TERMS[term][1]
    gas = holding_gas(start)

    def drive(rig: Rig) -> None:
        rig.inputs[GAS] = gas
        rig.inputs[STEER] = -0.05 * rig["Car.ty"] - rig["Car.Yaw"]

    return run(seconds, start, drive, h=h)


def residual(record: Record) -> Array:
    """Wheel speeds less the body's motion at each wheel [m/s], shape (n, 4)."""
    pitch, columns = record["Car.PitchVel"], []
    for c, hub in zip(CORNERS, LinearCar().hub, strict=True):
        height = hub[2] + record[f"Car.C{c}.q0"]
        along = record["Car.vx"] - record["Car.YawRate"] * hub[1] + pitch * height
        speed = record[f"Car.v{c}"]
        scale = speed.mean() / along.mean()
        columns.append(speed - scale * along + parameter("Wheel.KinematicRadius") * pitch)
    return np.column_stack(columns)


def in_band(x: Array, h: float = FINE) -> Array:
    """Band-passed, without what the filter and the road's beginning leave at the ends."""
    sections = signal.butter(4, BAND, "bandpass", fs=1.0 / h, output="sos")
    return np.asarray(signal.sosfiltfilt(sections, x, axis=0)[round(3.0 / h) : -round(1.0 / h)])


def rms(x: Array) -> Array:
    """Front and rear [m/s], shape (2,)."""
    return np.asarray(np.sqrt((x**2).reshape(len(x), 2, 2).mean(axis=(0, 2))))


# ---------------------------------------------------------------- what each term must be


def gain(record: Record, cause: Array, low: float, high: float) -> Array:
    """Mean real gain from a cause (n, 4) to the residual of its own wheel in a band, (4,)."""
    found = []
    for i in range(4):
        f, power = signal.welch(cause[:, i], 1.0 / FINE, nperseg=2048)
        cross = signal.csd(cause[:, i], residual(record)[:, i], 1.0 / FINE, nperseg=2048)[1]
        used = (f > low) & (f < high)
        found.append(float(cross[used].real.sum() / power[used].sum()))
    return np.array(found)


def others(*kept: str) -> tuple[str, ...]:
    return tuple(term for term in TERMS if term not in kept)


def test_knuckle_pitch_and_recession_are_the_locked_contact_path() -> None:
    """Hub moved back and knuckle turned: R k - recession per travel, as in anti-dive."""
    record = ride(30.0, FINE, *others("knuckle pitch", "recession"))
    extension = -record.corners("Car.C@.q0p")
    radius, k = parameter("Wheel.KinematicRadius"), per_corner("Kin.KnucklePitch@")
    expected = radius * k + per_corner("Kin.Recession@")
    bare = ride(30.0, FINE, *TERMS)
    found = gain(record, extension, 1.0, 5.0) - gain(bare, -bare.corners("Car.C@.q0p"), 1.0, 5.0)
    check = "knuckle pitch and recession alone, less none: v_rel to residual, 1 to 5 Hz, error [-]"
    oracle = "recession + R knuckle pitch"
    gate(SECTION, check, oracle, np.abs(found / expected - 1.0), at_most(0.04))


def test_rolling_radius_follows_the_load() -> None:
    """The wheel turns faster by v dRe/dFz / Re, to first order in the load."""
    record = ride(30.0, FINE, *others("rolling radius over load"))
    loads, nominal = record.corners("Car.Fz@"), parameter("Tire.NominalLoad")
    mean = loads.mean(axis=0) / nominal
    B, D, F = (parameter(f"Tire.{n}REFF") for n in "BDF")
    deflection = nominal / parameter("Tire.Stiffness")
    radius = parameter("Tire.Radius") - deflection * (F * mean + D * np.arctan(B * mean))
    slope = -deflection * (F + D * B / (1.0 + (B * mean) ** 2)) / nominal
    speed = record.corners("Car.v@").mean(axis=0)
    bare = ride(30.0, FINE, *TERMS)
    found = gain(record, loads, 1.0, 5.0) - gain(bare, bare.corners("Car.Fz@"), 1.0, 5.0)
    check = "rolling radius alone, less none: wheel load to residual, 1 to 5 Hz, error [-]"
    error = np.abs(found / (-speed * slope / radius) - 1.0)
    gate(SECTION, check, "derivative of the published radius", error, at_most(0.04))


# ---------------------------------------------------------------- shares


@pytest.mark.validation
def test_shares_of_the_terms() -> None:
    full, none = (rms(in_band(residual(ride(60.0, FINE, *o)))) for o in ((), tuple(TERMS)))
    rows: list[tuple[str | float, ...]] = [("all", "", *(1e3 * full), "", "")]
    for term, (source, _) in TERMS.items():
        alone = 1e3 * rms(in_band(residual(ride(60.0, FINE, *others(term)))))
        without = 1e3 * rms(in_band(residual(ride(60.0, FINE, term))))
        rows.append((term, source, *map(float, alone), *map(float, without)))
    rest = "slope of the road, inertia of wheels and rotors"
    rows.append(("none", rest, *(1e3 * none), "", ""))
    text = (
        "Residual of the wheel speeds on class B at 50 km/h, 0.5 to 25 Hz, rms in mm/s "
        "(suspension velocity beside it: "
        f"{1e3 * rms(in_band(ride(60.0, FINE).corners('Car.C@.q0p'))).mean():.1f} mm/s). The terms "
        "add with their signs, so one alone may exceed all together: in front knuckle pitch and "
        "rolling radius act against the recession, at the rear knuckle pitch and recession against "
        "the rolling radius. Knuckle pitch and recession together are the slope of the locked "
        "contact path, the very number that makes anti-dive and anti-lift, so a real car of known "
        "anti-dive has this coupling. Half-shafts, slip stiffness, bump steer and camber hardly "
        "count below 10 Hz."
    )
    header = ("term", "source", "alone, front", "alone, rear", "all but it, front", "rear")
    STUDIES.append(Study(SECTION, text, header, tuple(rows)))
    check = "all terms out: residual over that of all terms, front and rear [-]"
    gate(SECTION, check, "rigid rolling", none / full, at_most(0.2))


# ---------------------------------------------------------------- what can be known

SEGMENT = 256  # samples of a spectrum at 100 Hz
IMU = ("Car.ax", "Car.ay", "Car.az", "Car.RollVel", "Car.PitchVel", "Car.YawRate")


def spectra(x: Array) -> npt.NDArray[np.complex128]:
    """Windowed Fourier transforms of overlapping segments, (segments, frequencies, signals)."""
    window = signal.windows.hann(SEGMENT, sym=False)
    parts = np.lib.stride_tricks.sliding_window_view(x, SEGMENT, axis=0)[:: SEGMENT // 2]
    parts = parts - parts.mean(axis=2, keepdims=True)
    return np.asarray(np.fft.rfft(parts * window, axis=2).transpose(0, 2, 1))


def explained(y: Array, x: Array) -> tuple[Array, Array]:
    """Power of y (n, m) and the part that a linear filter of x (n, k) finds, (frequencies, m) each.

    Multiple coherence times spectrum, of a filter that may look ahead: a bound for any linear
    estimator.
    """
    Y, X = spectra(y), spectra(x)
    S = np.einsum("sfa,sfb->fab", X.conj(), X)
    s = np.einsum("sfa,sfm->fam", X.conj(), Y)
    part = np.einsum("fam,fam->fm", s.conj(), np.linalg.solve(S, s)).real
    return np.asarray((np.abs(Y) ** 2).sum(axis=0)), np.asarray(part)


@cache
def channels() -> tuple[Array, dict[str, Array]]:
    """Modes of the suspension velocity (n, 4), and groups of channels, 300 s at 100 Hz."""
    record = ride(300.0, COARSE)
    used = slice(500, None)
    modes = -record.corners("Car.C@.q0p")[used] @ np.array(list(MODES.values())).T / 2.0
    imu = np.column_stack([record[n] for n in IMU])[used]
    wheels = record.corners("Car.v@")[used]
    noise = 0.01 * np.random.default_rng(1).standard_normal(wheels.shape)
    stage = [record[n.replace("Car.", "Sensor.Imu.")] for n in IMU]
    rings = parameter("Wheel.KinematicRadius") * record.corners("Sensor.WheelSpd_@")
    groups = {
        "IMU": imu,
        "IMU, wheel speeds with 10 mm/s noise": np.hstack([imu, wheels + noise]),
        "IMU, wheel speeds": np.hstack([imu, wheels]),
        "IMU low-passed at 30 Hz, wheel speeds by 48 teeth": np.hstack(
            [np.column_stack(stage), rings]
        )[used],
    }
    return modes, groups


@cache
def unexplained(group: str) -> Array:
    """Share of each mode's power that no linear filter of the channels finds, shape (4,)."""
    modes, groups = channels()
    f = np.fft.rfftfreq(SEGMENT, COARSE)
    band = (f > BAND[0]) & (f < BAND[1])
    power, part = (values[band].sum(axis=0) for values in explained(modes, groups[group]))
    return np.asarray(1.0 - part / power)


@pytest.mark.validation
def test_what_the_channels_tell_of_the_modes() -> None:
    modes, groups = channels()
    size = 1e3 * modes.std(axis=0) / 2.0  # of one wheel
    left = {group: size * np.sqrt(unexplained(group)) for group in groups}
    left["(the modes themselves)"] = size
    rows = tuple((g, *map(float, x), float(np.linalg.norm(x))) for g, x in left.items())
    text = (
        "What is left of each mode of the suspension velocity, in mm/s at a wheel (0.5 to 25 Hz), "
        "after the best linear filter of the channels, which may look ahead: a bound for every "
        "linear estimator. 300 s of class B at 50 km/h. Heave, pitch and roll "
        "show in the IMU; the warp shows there only through the wheelbase delay, and the wheel "
        "speeds carry it, but in a residual of a few mm/s (table above): noise of 10 mm/s on "
        "them, white, takes most of it away again."
    )
    header = ("channels", *MODES, "all")
    STUDIES.append(Study(SECTION, text, header, rows))
    warp = list(MODES).index("warp")
    alone, both = (float(unexplained(g)[warp]) for g in ("IMU", "IMU, wheel speeds"))
    check = "warp power that the IMU leaves over that the wheel speeds leave as well [-]"
    gate(SECTION, check, "the wheel speeds carry the warp", alone / both, at_least(5.0))


# ---------------------------------------------------------------- pictures


@pytest.mark.validation
def test_picture_of_spectra(plots: Path) -> None:
    caption = (
        "Wheel-speed residual on class B at 50 km/h: spectra with all terms and with each term "
        "alone (front and rear); coherence of the residual with the wheel's own suspension "
        "velocity, and multiple coherence of the warp mode with residuals and with the IMU."
    )
    with picture(plots, SECTION, "wheel_speed_coupling", caption, ncols=3,
                 figsize=(12, 4)) as (_, axes):  # fmt: skip
        curves = {"all terms": (), **{f"{t} alone": others(t) for t in list(TERMS)[:5]},
                  "none": tuple(TERMS)}  # fmt: skip
        for label, out in curves.items():
            x = residual(ride(60.0, FINE, *out))[1500:]
            f, power = signal.welch(x, 1.0 / FINE, nperseg=2048, axis=0)
            f, power = log_bands(f, power, 0.4, 50.0)
            style = {"all terms": "k", "none": "k:"}.get(label, "")
            for ax, pair in zip(axes, (slice(0, 2), slice(2, 4)), strict=False):
                density = np.sqrt(power[:, pair].mean(axis=1))
                ax.loglog(f, 1e3 * density, style, label=label)
        for ax, axle in zip(axes, ("front", "rear"), strict=False):
            ax.set_title(f"residual, {axle}")
            ax.set_ylabel("amplitude density, (mm/s)/√Hz")
            ax.set_ylim(0.02, 8.0)
        axes[0].legend(fontsize=7, loc="lower left")
        draw_coherence(axes[2])
        for ax in axes:
            ax.set_xlabel("frequency, Hz")


def draw_coherence(ax: Any) -> None:
    record = ride(300.0, COARSE)
    x, v = residual(record)[500:], -record.corners("Car.C@.q0p")[500:]
    modes, groups = channels()
    warp = modes[:, [list(MODES).index("warp")]]
    pairs = {
        "own v_rel, from residual FL": (v[:, [0]], x[:, [0]]),
        "own v_rel, from residual RL": (v[:, [2]], x[:, [2]]),
        "warp, from four residuals": (warp, x),
        "warp, from the IMU": (warp, groups["IMU"]),
    }
    f = np.fft.rfftfreq(SEGMENT, COARSE)
    near = (f > 0.4) & (f < 40.0)
    for label, (y, x_) in pairs.items():
        power, part = explained(y, x_)
        ax.semilogx(f[near], (part / power)[near, 0], label=label)
    ax.set_title("coherence with v_rel")
    ax.set_ylabel("γ²")
    ax.set_ylim(0.0, 1.0)
    ax.legend(fontsize=7, loc="lower left")


@pytest.mark.validation
def test_picture_of_a_bump(plots: Path, tmp_path: Path) -> None:
    """0.05 m high and 2 m long under the left wheels, 25 km/h."""
    speed, v = 25.0 / 3.6, np.array([-4.5, -0.1, 0.1, 4.5])
    road = straight_road(
        tmp_path / "bump.crg",
        lambda s, w: cosine_bump(s, 5.0, 2.0, 0.05) * (w > 0.0),
        columns=v,
    )
    start: dict[str, Value] = {"Init.Velocity": speed, "Road.File": road, "Damp.Passive": True}
    record = run(2.0, start, h=0.001)
    caption = (
        "One cosine bump, 0.05 m high and 2 m long, under the left wheels at 25 km/h, passive "
        "dampers: road under the wheels, suspension velocity, wheel load, residual of the wheel "
        "speed."
    )
    panels = {
        "road, mm": 1e3 * record.corners("Car.zRoad@"),
        "suspension velocity, m/s": -record.corners("Car.C@.q0p"),
        "wheel load, kN": 1e-3 * record.corners("Car.Fz@"),
        "wheel-speed residual, m/s": residual(record),
    }
    with picture(plots, SECTION, "bump_passage", caption, nrows=2, ncols=2, figsize=(9, 5),
                 sharex=True) as (_, axes):  # fmt: skip
        for ax, (label, values) in zip(axes.ravel(), panels.items(), strict=True):
            for i, corner in enumerate(CORNERS):
                ax.plot(record.t, values[:, i], label=corner)
            ax.set_ylabel(label)
        for ax in axes[1]:
            ax.set_xlabel("time, s")
        axes[0, 0].legend()
