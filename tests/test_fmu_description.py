"""What the vehicle FMUs say of themselves: the XML of both FMI versions, as they are shipped."""

from __future__ import annotations

import math
import re
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import vehicle_fmus as fmus
from fmpy.validation import validate_fmu
from vehicle_rig import GAS, STEER, Rig, output_names

from cosim.vehicle import builtin_fmu
from sensor.channels import CHANNELS

pytestmark = pytest.mark.parametrize("version", fmus.VERSIONS)

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


def test_two_validators_find_nothing(version: int) -> None:
    path = str(builtin_fmu(version))
    assert validate_fmu(path) == []
    tool = shutil.which("fmutool", path=str(Path(sys.executable).parent))
    assert tool, "fmu-manipulation-toolbox is part of the test extra"
    command = [tool, "-input", path, "-check"]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    said = result.stdout + result.stderr
    assert f"seems to be compliant with FMI-{version}.0" in said
    assert f"No semantic error against the FMI-{version} standard" in said
    assert "ERROR" not in said
    assert "WARNING" not in said


def test_units_are_what_their_names_say(version: int) -> None:
    """SI exponents and factors, worked out from the names of units and display units."""
    units = fmus.description(version).unitDefinitions
    assert len(units) > 20
    for unit in units:
        base = unit.baseUnit
        stated = {n: getattr(base, n) for n in ("kg", "m", "s", "A", "K", "mol", "cd", "rad")}
        assert {n: p for n, p in stated.items() if p} == exponents(unit.name), unit.name
        assert (base.factor or 1.0, base.offset or 0.0) == (1.0, 0.0)
        for shown in unit.displayUnits:
            in_si = math.prod(FACTORS.get(s, 1.0) ** p for s, p in factors_of(shown.name))
            assert exponents(shown.name) == exponents(unit.name), shown.name
            assert float(shown.factor) == pytest.approx(1.0 / in_si, rel=1e-15)


def test_every_quantity_has_a_type(version: int) -> None:
    types = {t.name: t for t in fmus.description(version).typeDefinitions}
    assert {t.quantity for t in types.values()} == set(types)
    assert not set(types) & set(fmus.variables(version))
    for variable in fmus.variables(version).values():
        if variable.type in ("Real", "Float64"):
            assert variable.declaredType is types[variable.declaredType.name]
            assert variable.declaredType.unit == variable.unit


def test_limits_hold_their_start_values(version: int) -> None:
    limited = 0
    for v in fmus.variables(version).values():
        low = float(v.min) if v.min is not None else -math.inf
        high = float(v.max) if v.max is not None else math.inf
        assert low < high
        if v.start is not None and v.type in ("Real", "Float64"):
            assert low <= float(v.start) <= high, v.name
        limited += v.min is not None
    assert limited > 100
    pedals = {fmus.variables(version)[f"DM.{pedal}"] for pedal in ("Gas", "Brake")}
    assert {(float(v.min), float(v.max)) for v in pedals} == {(0.0, 1.0)}


def test_nominal_values_are_of_the_size_of_the_outputs(version: int) -> None:
    """Largest value of each output over a drive, against its own nominal value or its type's."""
    peak = np.zeros(len(output_names()))
    with Rig({"Init.Velocity": 15.0}, version=version) as rig:
        for k in range(300):
            rig.inputs[STEER], rig.inputs[GAS] = math.sin(0.03 * k), 0.5
            rig.step()
            np.maximum(peak, np.abs(rig.outputs), out=peak)
    for name, largest in zip(output_names(), peak, strict=True):
        variable = fmus.variables(version)[name]
        nominal = float(variable.nominal or variable.declaredType.nominal or 1.0)
        assert 0.0 < nominal < 1e9
        assert largest < 1e3 * nominal, name
        if largest > 1e-6:
            assert largest > 1e-4 * nominal, name


def test_the_default_experiment_runs(version: int) -> None:
    experiment = fmus.description(version).defaultExperiment
    start, stop = float(experiment.startTime), float(experiment.stopTime)
    step = float(experiment.stepSize)
    assert (start, step) == (0.0, 0.01)
    assert stop > 0.0
    with Rig(version=version, h=step) as rig:
        for _ in range(round(stop / step)):
            rig.step()
        assert rig["Car.tz"] == pytest.approx(0.65, abs=1e-3)  # it stands where it stood


def test_every_variable_is_described(version: int) -> None:
    every = fmus.variables(version).values()
    assert all(v.description and len(v.description) > 3 for v in every)
    texts = Counter((v.causality, v.description) for v in every)
    shared = [text for text, n in texts.items() if n > 1]
    assert shared == []


def test_categories_and_description_of_the_whole(version: int) -> None:
    root = fmus.xml(version)
    categories = root.findall("LogCategories/Category")
    assert {"logStatusError", "logStatusWarning"} <= {str(c.get("name")) for c in categories}
    assert all(c.get("description") for c in categories)
    for attribute in ("description", "author", "license", "version", "generationTool"):
        assert root.get(attribute), attribute
    assert root.get("variableNamingConvention") == "structured"


def test_time_is_the_independent_variable(version: int) -> None:
    time = fmus.variables(version)["time"]
    assert (time.causality, time.unit, time.start) == ("independent", "s", None)
    assert sum(v.causality == "independent" for v in fmus.variables(version).values()) == 1


def test_terminals_name_channels_and_damper_commands(version: int) -> None:
    """FMI 3.0; FMI 2.0.4 has taken terminals over."""
    root = fmus.xml(version, "terminalsAndIcons/terminalsAndIcons.xml")
    members = {
        str(terminal.get("name")): [str(m.get("variableName")) for m in terminal]
        for terminal in root.findall("Terminals/Terminal")
    }
    assert members["Channels"] == [channel.name for channel in CHANNELS]
    assert len(members["Channels"]) == 14
    assert members["DamperCommands"] == [
        f"Car.SuspControl.Damper{corner}.CtrlOut" for corner in ("FL", "FR", "RL", "RR")
    ]
    causalities = {
        name: {fmus.variables(version)[m].causality for m in of} for name, of in members.items()
    }
    assert causalities == {"Channels": {"output"}, "DamperCommands": {"input"}}
    for terminal in root.findall("Terminals/Terminal"):
        assert terminal.get("matchingRule") == "plug"
        assert terminal.get("terminalKind")
        assert {m.get("variableKind") for m in terminal} == {"signal"}
        assert all(m.get("memberName") == m.get("variableName") for m in terminal)
