"""What the FMUs say of themselves: the XML of vehicle and sensors, of both FMI versions."""

from __future__ import annotations

import math
import re
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path

import fmpy
import numpy as np
import pytest
import shipped_fmus as fmus
from fmpy.validation import validate_fmu
from vehicle_rig import GAS, STEER, Rig, output_names

from sensor.channels import CHANNELS, OUTPUTS

every = pytest.mark.parametrize("fmu", fmus.ALL, ids=str)
vehicles = pytest.mark.parametrize("fmu", fmus.VEHICLES, ids=str)

COMMANDS = tuple(f"Car.SuspControl.Damper{corner}.CtrlOut" for corner in ("FL", "FR", "RL", "RR"))
SI = {
    "1": "", "m": "m", "s": "s", "kg": "kg", "rad": "rad", "Hz": "/s", "N": "kg m /s/s",
    "J": "kg m m /s/s", "W": "kg m m /s/s/s",
}  # fmt: skip
FACTORS = {"mm": 1e-3, "km": 1e3, "h": 3600.0, "ms": 1e-3, "deg": math.pi / 180, "kN": 1e3,
           "kW": 1e3, "kJ": 1e3}  # fmt: skip
IN_SI = {"mm": "m", "km": "m", "h": "s", "ms": "s", "deg": "rad", "kN": "N", "kW": "W", "kJ": "J"}


def factors_of(name: str) -> list[tuple[str, int]]:
    """A unit's name as powers: "N.m.s/rad" -> N 1, m 1, s 1, rad -1; "m/s2" -> m 1, s -2."""
    above, _, below = name.partition("/")
    parts = [(part, 1) for part in above.split(".")] + [(p, -1) for p in below.split(".") if p]
    powers = []
    for part, sign in parts:
        symbol, power = re.fullmatch(r"([A-Za-z]+|1)(\d?)", part).groups()  # type: ignore[union-attr]
        powers.append((symbol, sign * int(power or 1)))
    return powers


def exponents(name: str) -> Counter[str]:
    """SI base exponents that a unit's name stands for."""
    total: Counter[str] = Counter()
    for symbol, power in factors_of(name):
        above, *below = SI[IN_SI.get(symbol, symbol)].split("/")
        for base in above.split():
            total[base] += power
        for base in below:
            total[base.strip()] -= power
    return Counter({base: power for base, power in total.items() if power})


@every
def test_two_validators_find_nothing(fmu: fmus.Shipped) -> None:
    path = str(fmu.path)
    assert validate_fmu(path) == []
    tool = shutil.which("fmutool", path=str(Path(sys.executable).parent))
    assert tool, "fmu-manipulation-toolbox is part of the test extra"
    command = [tool, "-input", path, "-check"]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    said = result.stdout + result.stderr
    assert f"seems to be compliant with FMI-{fmu.version}.0" in said
    assert f"No semantic error against the FMI-{fmu.version} standard" in said
    assert "ERROR" not in said
    assert "WARNING" not in said


@every
def test_units_are_what_their_names_say(fmu: fmus.Shipped) -> None:
    """SI exponents and factors, worked out from the names of units and display units."""
    units = fmus.description(fmu).unitDefinitions
    assert len(units) >= 6
    for unit in units:
        base = unit.baseUnit
        stated = {n: getattr(base, n) for n in ("kg", "m", "s", "A", "K", "mol", "cd", "rad")}
        assert {n: p for n, p in stated.items() if p} == exponents(unit.name), unit.name
        assert (base.factor or 1.0, base.offset or 0.0) == (1.0, 0.0)
        for shown in unit.displayUnits:
            in_si = math.prod(FACTORS.get(s, 1.0) ** p for s, p in factors_of(shown.name))
            assert exponents(shown.name) == exponents(unit.name), shown.name
            assert float(shown.factor) == pytest.approx(1.0 / in_si, rel=1e-15)


@every
def test_every_quantity_has_a_type(fmu: fmus.Shipped) -> None:
    types = {t.name: t for t in fmus.description(fmu).typeDefinitions}
    assert {t.quantity for t in types.values()} == set(types)
    assert not set(types) & set(fmus.variables(fmu))
    for variable in fmus.variables(fmu).values():
        if variable.type in ("Real", "Float64"):
            assert variable.declaredType is types[variable.declaredType.name]
            assert variable.declaredType.unit == variable.unit


@every
def test_limits_hold_their_start_values(fmu: fmus.Shipped) -> None:
    limited = 0
    for v in fmus.variables(fmu).values():
        low = float(v.min) if v.min is not None else -math.inf
        high = float(v.max) if v.max is not None else math.inf
        assert low < high
        if v.start is not None and v.type in ("Real", "Float64"):
            assert low <= float(v.start) <= high, v.name
        limited += v.min is not None
    assert limited > (100 if fmu.model == "vehicle" else 13)
    zero_to_one = {"vehicle": ("DM.Gas", "DM.Brake"), "carried": COMMANDS}.get(fmu.model, ())
    for name in zero_to_one:
        v = fmus.variables(fmu)[name]
        assert (float(v.min), float(v.max)) == (0.0, 1.0)


@vehicles
def test_nominal_values_are_of_the_size_of_the_outputs(fmu: fmus.Shipped) -> None:
    """Largest value of each output over a drive, against its own nominal value or its type's."""
    peak = np.zeros(len(output_names()))
    with Rig({"Init.Velocity": 15.0}, version=fmu.version) as rig:
        for k in range(300):
            rig.inputs[STEER], rig.inputs[GAS] = math.sin(0.03 * k), 0.5
            rig.step()
            np.maximum(peak, np.abs(rig.outputs), out=peak)
    for name, largest in zip(output_names(), peak, strict=True):
        variable = fmus.variables(fmu)[name]
        nominal = float(variable.nominal or variable.declaredType.nominal or 1.0)
        assert 0.0 < nominal < 1e9
        assert largest < 1e3 * nominal, name
        if largest > 1e-6:
            assert largest > 1e-4 * nominal, name


@pytest.mark.parametrize("fmu", fmus.SENSORS, ids=str)
def test_the_default_experiment_of_a_sensor_runs(fmu: fmus.Shipped) -> None:
    result = fmpy.simulate_fmu(str(fmu.path), validate=True, output=["VRel.FL", "Sensor.Valid"])
    assert len(result) == 1001
    assert np.isfinite(result["VRel.FL"]).all()
    assert result["Sensor.Valid"][-1]


@vehicles
def test_the_default_experiment_runs(fmu: fmus.Shipped) -> None:
    experiment = fmus.description(fmu).defaultExperiment
    start, stop = float(experiment.startTime), float(experiment.stopTime)
    step = float(experiment.stepSize)
    assert (start, step) == (0.0, 0.01)
    assert stop > 0.0
    with Rig(version=fmu.version, h=step) as rig:
        for _ in range(round(stop / step)):
            rig.step()
        assert rig["Car.tz"] == pytest.approx(0.65, abs=1e-3)  # it stands where it stood


@every
def test_every_variable_is_described(fmu: fmus.Shipped) -> None:
    known = fmus.variables(fmu).values()
    assert all(v.description and len(v.description) > 3 for v in known)
    texts = Counter((v.causality, v.description) for v in known)
    shared = [text for text, n in texts.items() if n > 1]
    assert shared == []


@every
def test_categories_and_description_of_the_whole(fmu: fmus.Shipped) -> None:
    root = fmus.xml(fmu)
    categories = root.findall("LogCategories/Category")
    assert {"logStatusError", "logStatusWarning"} <= {str(c.get("name")) for c in categories}
    assert all(c.get("description") for c in categories)
    for attribute in ("description", "author", "license", "version", "generationTool"):
        assert root.get(attribute), attribute
    assert root.get("variableNamingConvention") == "structured"


@every
def test_time_is_the_independent_variable(fmu: fmus.Shipped) -> None:
    time = fmus.variables(fmu)["time"]
    assert (time.causality, time.unit, time.start) == ("independent", "s", None)
    assert sum(v.causality == "independent" for v in fmus.variables(fmu).values()) == 1


@every
def test_terminals_name_channels_commands_and_velocities(fmu: fmus.Shipped) -> None:
    """FMI 3.0; FMI 2.0.4 has taken terminals over. Names are one for plug and socket."""
    root = fmus.xml(fmu, "terminalsAndIcons/terminalsAndIcons.xml")
    members = {
        str(terminal.get("name")): [str(m.get("variableName")) for m in terminal]
        for terminal in root.findall("Terminals/Terminal")
    }
    channels, commands = [channel.name for channel in CHANNELS], list(COMMANDS)
    velocities = [output.name for output in OUTPUTS]
    wanted, side = {"Channels": channels, "DamperCommands": commands}, "output"
    if fmu.model != "vehicle":
        wanted, side = {**wanted, "SuspensionVelocities": velocities}, "input"
    if fmu.model == "windowed":
        del wanted["DamperCommands"]
    assert members == wanted
    causalities = {
        name: {fmus.variables(fmu)[m].causality for m in of} for name, of in members.items()
    }
    sides = {"Channels": side, "DamperCommands": "input", "SuspensionVelocities": "output"}
    assert causalities == {name: {sides[name]} for name in wanted}
    for terminal in root.findall("Terminals/Terminal"):
        assert terminal.get("matchingRule") == "plug"
        assert terminal.get("terminalKind")
        assert {m.get("variableKind") for m in terminal} == {"signal"}
        assert all(m.get("memberName") == m.get("variableName") for m in terminal)
