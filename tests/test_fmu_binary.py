"""The binaries of the FMUs: symbols, order of calls, logging, and the flags they keep."""

from __future__ import annotations

import ctypes
import math
import re
import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import shipped_fmus as fmus
from fmpy.fmi1 import FMICallException
from fmu_face import ERROR, OK, WARNING, Face, instances, package, refused, toolchain

Make = Callable[..., Face]
H = 0.01


ODD = "a b%20 Fahrwerk-Prüfstand #1 道路 "
NAMES = {"vehicle": ("DM.Gas", "Car.vx"), "sensor": ("Car.ax", "VRel.FL")}  # an input, an output


@pytest.fixture(scope="module", params=fmus.ALL, ids=str)
def fmu(request: pytest.FixtureRequest) -> fmus.Shipped:
    return request.param


@pytest.fixture(scope="module")
def folder(fmu: fmus.Shipped) -> Iterator[Path]:
    with fmus.unzipped(fmu, ODD) as path:
        yield path


@pytest.fixture(scope="module", params=fmus.VEHICLES, ids=str)
def car_folder(request: pytest.FixtureRequest) -> Iterator[Path]:
    with fmus.unzipped(request.param, ODD) as path:
        yield path


@pytest.fixture
def make_car(car_folder: Path) -> Iterator[Make]:
    """Makes instances of the vehicle and frees them."""
    with instances(Face, car_folder) as new:
        yield new


@pytest.fixture
def make(folder: Path) -> Iterator[Make]:
    """Makes instances and frees them."""
    with instances(Face, folder) as new:
        yield new


def test_every_symbol_of_the_standard_and_no_other(fmu: fmus.Shipped, tmp_path: Path) -> None:
    nm = shutil.which("nm")
    if nm is None:
        pytest.skip("needs nm")
    header = toolchain.header_directory() / f"fmi{fmu.version}Functions.h"
    pattern = rf"^#define (fmi{fmu.version}\w+) +fmi{fmu.version}FullName"
    standard = set(re.findall(pattern, header.read_text(encoding="utf-8"), re.M))
    binary = tmp_path / "model.so"
    path = package.binary_path(fmu.identifier, fmu.version, toolchain.target_platform())
    binary.write_bytes(fmus.entry(fmu, path))
    command = [nm, "-D", "--defined-only", str(binary)]
    listing = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert {line.split()[-1] for line in listing.splitlines()} == standard
    assert len(standard) > 40


def test_the_token_is_checked(make: Make) -> None:
    for token in ("{}", "{00000000-0000-0000-0000-000000000000}", "x" * 5000):
        with pytest.raises(Exception, match="instantiate"):
            make(token=token)


def test_calls_in_the_wrong_order_answer_error(make: Make, fmu: fmus.Shipped) -> None:
    face = make()
    an_input, output = NAMES[fmu.identifier]
    assert "DoStep was called before initialization mode" in refused(face, lambda: face.step(0, H))
    assert "ExitInitializationMode" in refused(face, face.fmu.exitInitializationMode)
    assert "Terminate" in refused(face, face.fmu.terminate)
    assert f"{output} has no value before" in refused(face, lambda: face[output])
    face.initialise()
    assert "EnterInitializationMode" in refused(face, face.fmu.enterInitializationMode)
    if fmu.model == "vehicle":
        assert "fixed parameter" in refused(face, lambda: face.__setitem__("Body.Mass", 2000.0))
    assert "is an output" in refused(face, lambda: face.__setitem__(output, 1.0))
    face.step(0, H)
    face.fmu.terminate()
    assert "after termination" in refused(face, lambda: face.step(1, H))
    assert "after termination" in refused(face, lambda: face.__setitem__(an_input, 0.5))
    assert "Terminate was called after termination" in refused(face, face.fmu.terminate)
    assert math.isfinite(face[output])  # the last values stay readable


def test_a_step_past_the_stop_time_is_an_error(make: Make) -> None:
    """Both standards: past a defined stop time the FMU must return Error; none defined, no end."""
    face = make().initialise(stop=0.02)
    face.step(0, H)
    face.step(1, H)
    assert "would pass the stop time 0.02" in refused(face, lambda: face.step(2, H))
    assert "would pass the stop time" in refused(face, lambda: face.fmu.doStep(0.02, 1e-3))
    endless = make().initialise()
    endless.fmu.doStep(0.0, 2.0)


def test_a_step_of_more_internal_steps_than_can_be_counted_is_refused(make_car: Make) -> None:
    """2^31 steps of 0.01 ms are six hours: a time in the wrong unit is more likely."""
    for step in (21474.84, 1e300):
        face = make_car().initialise(Solver_Step=1e-5)
        said = refused(face, lambda h=step, f=face: f.fmu.doStep(0.0, h))
        assert f"a step of {step:g} s is cut into" in said
        face.fmu.reset()
        face.initialise().step(0, H)


def test_messages_have_declared_categories_and_no_worse_a_status(make_car: Make) -> None:
    face = make_car()
    declared = {
        str(c.get("name"))
        for c in fmus.xml(fmus.Shipped("vehicle", face.version)).findall("LogCategories/Category")
    }
    statuses = []
    for call in (
        lambda: face.set_status("Body.Mass", 3.0),
        lambda: face.set_status("DM.Gas", 2.0),
        lambda: face.set_status("DM.Gas", 3.0),
        lambda: face.set_status("Car.vx", 3.0),
        lambda: face.set_status("DM.Gas", math.nan),
        lambda: face.call("Terminate"),
        lambda: face.call("SetDebugLogging", 1, ctypes.c_size_t(1), (ctypes.c_char_p * 1)(b"?")),
    ):
        before = len(face.messages)
        statuses.append(call())
        said = face.messages[before:]
        assert [m[0] for m in said] == ([statuses[-1]] if statuses[-1] else [])
    assert statuses == [ERROR, WARNING, OK, ERROR, ERROR, ERROR, ERROR]
    with pytest.raises(FMICallException):
        face.initialise(Road_File="none.crg")
    assert face.messages[-1][:2] == (ERROR, "logRoad")
    assert "none.crg" in face.last
    assert {m[1] for m in face.messages} <= declared


def test_no_logger(make: Make, fmu: fmus.Shipped) -> None:
    face = make(logger=False)
    an_input, output = NAMES[fmu.identifier]
    assert face.set_status(an_input, 1e4) == WARNING
    assert face.set_status(output, 3.0) == ERROR
    face.initialise().step(0, H)


def test_inputs_beyond_their_range_act_at_their_limits(make_car: Make) -> None:
    """The damper map ends at 0 and 1: docs/decisions/0008."""
    within, beyond = (make_car().initialise(stop=None) for _ in range(2))
    for k in range(50):
        for corner in ("FL", "FR", "RL", "RR"):
            command = f"Car.SuspControl.Damper{corner}.CtrlOut"
            within.set_status(command, float(k % 2))
            beyond.set_status(command, 2.5 * (k % 2) - 1.0 * (1 - k % 2))
        for face, gas in ((within, 1.0), (beyond, 7.0)):
            face.set_status("DM.Gas", gas)
            face.step(k, H)
    for name in ("Car.vx", "Car.CFL.q0", "Car.DampRR.Frc", "Car.DampFL.Ctrl", "DM.Gas"):
        assert within[name] == beyond[name]
    assert within.messages == []
    assert [m[0] for m in beyond.messages] == [WARNING] * 5  # four dampers and the pedal


def test_flags_that_are_set_are_kept(make: Make, fmu: fmus.Shipped) -> None:
    simulation = fmus.description(fmu).coSimulation
    assert simulation.canGetAndSetFMUstate
    assert simulation.canSerializeFMUstate
    assert simulation.canHandleVariableCommunicationStepSize
    one, two = make().initialise(), make().initialise()  # more than one in a process
    one.restore(two.serialize())
    one.fmu.doStep(0.0, 0.013)
    one.fmu.doStep(0.013, 0.0007)
    if fmu.model == "vehicle":
        assert one["Car.tz"] == pytest.approx(0.65, abs=1e-3)


def test_flags_that_are_not_set_are_refusals(make: Make, fmu: fmus.Shipped) -> None:
    """What the description does not offer is not there."""
    element = fmus.xml(fmu).find("CoSimulation")
    assert element is not None
    assert set(element.keys()) - {"modelIdentifier"} == {
        "canHandleVariableCommunicationStepSize",
        *(
            ("canGetAndSetFMUstate", "canSerializeFMUstate", "canNotUseMemoryManagementFunctions")
            if fmu.version == 2
            else ("canGetAndSetFMUState", "canSerializeFMUState")
        ),
    }
    face = make().initialise()
    none, size = None, ctypes.c_size_t(0)
    absent = {
        2: [
            ("CancelStep",),
            ("SetRealInputDerivatives", none, size, none, none),
            ("GetRealOutputDerivatives", none, size, none, none),
            ("GetDirectionalDerivative", none, size, none, size, none, none),
        ],
        3: [
            ("EnterEventMode",),
            ("EnterConfigurationMode",),
            ("GetOutputDerivatives", none, size, none, none, size),
            ("GetDirectionalDerivative", none, size, none, size, none, size, none, size),
            ("GetAdjointDerivative", none, size, none, size, none, size, none, size),
            ("GetNumberOfVariableDependencies", ctypes.c_uint(0), none),
            ("GetClock", none, size, none),
        ],
    }[face.version]
    for name, *arguments in absent:
        assert "is not available" in face.refusal(name, *arguments)
    face.step(0, H)


@pytest.mark.parametrize("kind", ["vehicle", *fmus.KINDS])
def test_no_memory_functions_are_used(kind: str) -> None:
    """CanNotUseMemoryManagementFunctions of FMI 2: the FMU lives without them (Face gives none)."""
    with fmus.unzipped(fmus.Shipped(kind, 2)) as path:
        face = Face(path)
        assert not face.callbacks.allocateMemory
        assert not face.callbacks.freeMemory
        face.initialise().step(0, H)
        face.serialize()
        face.free()
