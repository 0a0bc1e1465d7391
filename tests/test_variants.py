"""Vehicle variants: their files, what they mean together, and what they do to the car."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from loop_rig import Blind, write_scenario
from vehicle_rig import run

from cosim.assembly import assemble
from cosim.errors import InputError
from cosim.fmi import Description
from cosim.scenario.load import load
from cosim.scenario.schema import Scenario
from cosim.scenario.variants import PointMass, load_of, variant_names
from cosim.start import checked_parameters
from cosim.vehicle import builtin_fmu

G = 9.81
CORNERS = ("FL", "FR", "RL", "RR")
COLUMNS = {q: [f"Car.{q.replace('@', c)}" for c in CORNERS] for q in ("Fz@", "C@.q0")}


def with_variants(folder: Path, *names: str, **sections: str) -> Scenario:
    vehicle = f"{{variants: [{', '.join(names)}]}}"
    return load(write_scenario(folder, sections={"vehicle": vehicle} | sections))


def complaints(folder: Path, vehicle: str) -> list[str]:
    with pytest.raises(InputError) as caught:
        load(write_scenario(folder, sections={"vehicle": vehicle}))
    return [str(problem) for problem in caught.value.problems]


def parameter(name: str) -> float:
    return float(Description(builtin_fmu()).variables[name].start)


def at_rest(scenario: Scenario) -> dict[str, np.ndarray]:
    """Wheel loads [N] and travels [m] of the standing car."""
    record = run(0.0, scenario.parameters)
    return {name: np.array([record[c][0] for c in columns]) for name, columns in COLUMNS.items()}


# ---------------------------------------------------------------- files and names


@pytest.mark.parametrize("name", variant_names())
def test_every_variant_of_the_package_fits_the_vehicle(tmp_path: Path, name: str) -> None:
    scenario = with_variants(tmp_path, name)
    assert not checked_parameters(scenario, Description(builtin_fmu()))
    assert scenario.variants.files[name].stem == name
    changed = {n for n, value in scenario.parameters.items() if value != parameter(n)}
    assert changed == set(scenario.parameters)


def test_one_name_needs_no_list(tmp_path: Path) -> None:
    path = write_scenario(tmp_path)
    assert load(path, ["vehicle.variants=payload"]).parameters["Load.Mass"] == 186.0


def test_own_parameters_override_those_of_variants(tmp_path: Path) -> None:
    vehicle = "{variants: [payload, worn_dampers], parameters: {Damp.ScaleFL: 0.7, Load.Mass: 99}}"
    parameters = load(write_scenario(tmp_path, sections={"vehicle": vehicle})).parameters
    assert (parameters["Damp.ScaleFL"], parameters["Damp.ScaleFR"]) == (0.7, 0.5)
    assert parameters["Load.Mass"] == 99


def test_two_variants_must_not_set_the_same_unless_it_is_decided(tmp_path: Path) -> None:
    both = "variants: [worn_dampers, stiff_dampers]"
    (complaint,) = complaints(tmp_path, f"{{{both}}}")
    assert "scenario.yaml:5:" in complaint
    assert (
        "variants 'worn_dampers' and 'stiff_dampers' both set Damp.ScaleFL; take one" in complaint
    )
    decided = ", ".join(f"Damp.Scale{corner}: 1" for corner in CORNERS)
    vehicle = f"{{{both}, parameters: {{{decided}}}}}"
    scenario = load(write_scenario(tmp_path, sections={"vehicle": vehicle}))
    assert scenario.parameters["Damp.ScaleRL"] == 1


@pytest.mark.parametrize(
    ("names", "sentence"),
    [
        ("payloads", "'payloads' is no variant; choose payload, "),
        ("worn_damper", "did you mean 'worn_dampers'?"),
        ("payload, payload", "variant 'payload' is given twice"),
        ("mine.yaml", "there is no file"),
        ("3", "must be text"),
    ],
)
def test_a_name_that_is_none(tmp_path: Path, names: str, sentence: str) -> None:
    (complaint,) = complaints(tmp_path, f"{{variants: [{names}]}}")
    assert sentence in complaint
    assert "scenario.yaml:5:" in complaint


OWN = "name: mine\ndescription: a\nsource: b\n"


@pytest.mark.parametrize(
    ("text", "place", "sentence"),
    [
        ("", "mine.yaml is empty; a variant needs name", ""),
        (OWN, "mine.yaml:1:1", "a variant needs parameters or loads"),
        (OWN + "parametrs: {}\n", "mine.yaml:4:1", "not a field of a variant; did you mean"),
        (OWN + "parameters: {Body.Mass: []}\n", "mine.yaml:4:25", "must be one finite number"),
        (OWN + "loads: [{what: a, mass_kg: -1, x_m: 0, y_m: 0, z_m: 0}]\n", "mine.yaml:4:", "kg"),
        ("name: mine\nname: b\n", "mine.yaml:2:1", "already given in line 1"),
    ],
)
def test_a_file_of_ones_own_with_mistakes(
    tmp_path: Path, text: str, place: str, sentence: str
) -> None:
    (tmp_path / "mine.yaml").write_text(text)
    found = complaints(tmp_path, "{variants: [mine.yaml]}")
    assert any(place in complaint and sentence in complaint for complaint in found), found


def test_a_file_of_ones_own(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text(OWN + "parameters: {Body.Mass: 2600}\n")
    scenario = with_variants(tmp_path, "mine.yaml", "worn_dampers")
    assert scenario.parameters["Body.Mass"] == 2600
    built = assemble(scenario, scenario.controllers[0], sensor=Blind())
    built.blocks.vehicle.stop()
    assert built.files["variant mine"] == (tmp_path / "mine.yaml").resolve()


def test_a_parameter_that_the_fmu_lacks_is_shown_at_the_variant(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text(OWN + "parameters: {Bdy.Mass: 2600}\n")
    scenario = with_variants(tmp_path, "mine.yaml")
    with pytest.raises(InputError) as caught:
        assemble(scenario, scenario.controllers[0], sensor=Blind())
    assert "scenario.yaml:5:22: " in str(caught.value)
    assert "no parameter 'Bdy.Mass'; did you mean 'Body.Mass'?" in str(caught.value)


# ---------------------------------------------------------------- loads


def test_a_load_of_point_masses() -> None:
    """A dumbbell: two masses m at +-a from their middle have m (2 a)^2 / 2 across, 0 along."""
    ends = [PointMass(what="end", mass_kg=30, x_m=x, y_m=0.2, z_m=0.1) for x in (-1.5, 0.5)]
    load = load_of(ends)
    assert (load["Load.Mass"], load["Load.X"]) == pytest.approx((60.0, -0.5))
    assert (load["Load.Y"], load["Load.Z"]) == pytest.approx((0.2, 0.1))
    inertias = [load[f"Load.Inertia{axis}"] for axis in ("Roll", "Pitch", "Yaw")]
    assert inertias == pytest.approx([0.0, 60.0, 60.0])


def test_loads_of_two_variants_add_up(tmp_path: Path) -> None:
    (tmp_path / "box.yaml").write_text(
        OWN + "loads: [{what: roof box, mass_kg: 64, x_m: -0.2, y_m: 0, z_m: 1.1}]\n"
    )
    parameters = with_variants(tmp_path, "payload", "box.yaml").parameters
    assert parameters["Load.Mass"] == pytest.approx(250.0)
    assert parameters["Load.Z"] == pytest.approx((136 * 0.2 + 50 * 0.15 + 64 * 1.1) / 250)


@pytest.mark.parametrize("name", ["payload", "payload_400kg"])
def test_a_payload_loads_the_wheels_and_sinks_the_car(tmp_path: Path, name: str) -> None:
    """Moments about the wheels' contact, against the empty car; the springs give way."""
    scenario = with_variants(tmp_path, name)
    p = scenario.parameters
    assert isinstance(p["Load.Mass"], float)
    empty, loaded = at_rest(with_variants(tmp_path)), at_rest(scenario)
    more = loaded["Fz@"] - empty["Fz@"]
    assert more.sum() == pytest.approx(G * p["Load.Mass"], rel=1e-4)
    rear = (parameter("Body.CogToFront") - float(p["Load.X"])) / 2.675
    assert more[2:].sum() / more.sum() == pytest.approx(rear, abs=0.02)  # the car tilts a little
    rates = np.array([parameter(f"Susp.WheelRate{c}") for c in CORNERS])
    assert loaded["C@.q0"] == pytest.approx(more / rates, rel=0.06)  # less the bars' share
    assert (loaded["C@.q0"] > 0.002).all()
    assert np.abs(empty["C@.q0"]).max() < 1e-4


# ---------------------------------------------------------------- dampers and tyres


def driven(folder: Path, *names: str) -> np.ndarray:
    """Suspension velocities on class C at 50 km/h, (samples, 4) [m/s]."""
    vehicle = f"{{variants: [{', '.join(names)}]}}"
    path = write_scenario(folder, duration="6", surface="C", sections={"vehicle": vehicle})
    scenario = load(path)
    built = assemble(scenario, scenario.controllers[0], sensor=Blind())
    built.run(None)
    return built.recorder.group("truth")[200:].copy()


def test_dampers_change_the_wheels_that_they_are_at(tmp_path: Path) -> None:
    rms = {
        name: np.sqrt(np.mean(driven(tmp_path, *([name] if name else [])) ** 2, axis=0))
        for name in ("", "worn_dampers", "worn_dampers_rear", "worn_damper_front_left",
                     "stiff_dampers")
    }  # fmt: skip
    ratio = {name: found / rms[""] for name, found in rms.items()}
    assert (ratio["worn_dampers"] > 1.15).all()
    assert (ratio["stiff_dampers"] < 0.92).all()
    assert (ratio["worn_dampers_rear"][2:] > 1.15).all()
    assert ratio["worn_dampers_rear"][:2] == pytest.approx(1.0, abs=0.05)
    assert ratio["worn_damper_front_left"][0] > 1.15
    assert ratio["worn_damper_front_left"][[1, 2, 3]] == pytest.approx(1.0, abs=0.08)


# published coefficients of 205/60 R15, MF-Tyre 6.1
PFZ1, PPX1, PPX2, PPX3, PPX4 = 0.7098, -0.3485, 0.37824, -0.09603, 0.06518
PPY1, PPY2, PPY3, PPY4, PCFY3 = -0.6255, -0.06523, -0.16666, 0.2811, 0.24993


@pytest.mark.parametrize(
    ("name", "dpi"), [("tyre_pressure_low", -0.25), ("tyre_pressure_high", 0.25)]
)
def test_tyre_pressure_follows_the_published_formulae(
    tmp_path: Path, name: str, dpi: float
) -> None:
    p = with_variants(tmp_path, name).parameters
    ratio = {n: float(value) / parameter(n) for n, value in p.items()}
    slip = 1 + PPX1 * dpi + PPX2 * dpi**2

    def cornering(pky1: float, pky2: float) -> float:
        return pky1 * float(np.sin(2 * np.arctan(1 / pky2)))

    before = cornering(parameter("Tire.PKY1"), parameter("Tire.PKY2"))
    after = before * (1 + PPY1 * dpi) * cornering(1, parameter("Tire.PKY2") * (1 + PPY2 * dpi))
    after /= cornering(1, parameter("Tire.PKY2"))
    assert ratio["Tire.Stiffness"] == pytest.approx(1 + PFZ1 * dpi, rel=1e-3)
    for n in ("Tire.PKX1", "Tire.PKX2", "Tire.RelaxationX"):
        assert ratio[n] == pytest.approx(slip, rel=1e-3)
    assert ratio["Tire.FrictionX"] == pytest.approx(1 + PPX3 * dpi + PPX4 * dpi**2, rel=1e-3)
    assert ratio["Tire.FrictionY"] == pytest.approx(1 + PPY3 * dpi + PPY4 * dpi**2, rel=1e-3)
    now = cornering(float(p["Tire.PKY1"]), float(p["Tire.PKY2"]))
    assert now == pytest.approx(after, rel=1e-3)
    assert ratio["Tire.PTY1"] == pytest.approx(now / before / (1 + PCFY3 * dpi), rel=1e-3)
    assert ratio["Road.PatchLength"] == pytest.approx((1 + PFZ1 * dpi) ** -0.5, rel=1e-3)
    assert ratio["Tire.QSY1"] == pytest.approx((1 + dpi) ** -0.4, rel=1e-3)


def test_less_pressure_makes_the_wheels_turn_faster(tmp_path: Path) -> None:
    """Which is how a car without pressure sensors notices: some tenths of a per cent."""
    speed = {}
    for name in ("tyre_pressure_low", "tyre_pressure_high"):
        start = with_variants(tmp_path, name).parameters | {"Init.Velocity": 20.0}
        record = run(1.0, start)
        speed[name] = record["Car.WheelSpd_FL"][-1] / record["Car.vx"][-1]
    faster = speed["tyre_pressure_low"] / speed["tyre_pressure_high"] - 1
    assert 0.003 < faster < 0.03
