"""Names of units, against SciPy's constants and against each other."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import constants

from cosim.check.unit_names import DIMENSIONS, readings

BASE = {
    "m": {"m": 1},
    "kg": {"kg": 1},
    "s": {"s": 1},
    "A": {"A": 1},
    "K": {"K": 1},
    "mol": {"mol": 1},
    "cd": {"cd": 1},
}


def exponents(**given_: int) -> tuple[int, ...]:
    return tuple(given_.get(name, 0) for name in DIMENSIONS)


@pytest.mark.parametrize(
    ("name", "factor"),
    [
        ("km/h", constants.kmh), ("mph", constants.mph), ("kn", constants.knot),
        ("in", constants.inch), ("ft", constants.foot), ("yd", constants.yard),
        ("mi", constants.mile), ("nmi", constants.nautical_mile), ("lb", constants.pound),
        ("oz", constants.oz), ("lbf", constants.pound_force), ("psi", constants.psi),
        ("bar", constants.bar), ("atm", constants.atm), ("Torr", constants.torr),
        ("mmHg", constants.mmHg), ("hp", constants.hp), ("deg", constants.degree),
        ("arcmin", constants.arcmin), ("l", constants.liter), ("gal", constants.gallon),
        ("cal", constants.calorie), ("BTU", constants.Btu), ("eV", constants.eV),
        ("min", constants.minute), ("h", constants.hour), ("d", constants.day),
        ("ha", constants.hectare), ("dyn", constants.dyn), ("erg", constants.erg),
        ("t", 1000 * constants.gram * 1000), ("kgf", constants.kgf), ("g", constants.g),
        ("kWh", constants.kilo * constants.hour), ("l/min", constants.liter / 60),
        ("deg/s", constants.degree), ("rpm", 2 * constants.pi / 60), ("%", 0.01),
        ("N.m/deg", 1 / constants.degree), ("kN/mm", 1e6), ("J/(g.K)", 1e3), ("g/cm3", 1e3),
        ("AU", constants.au), ("slug", constants.slug),
    ],
)  # fmt: skip
def test_factors_are_those_of_scipy(name: str, factor: float) -> None:
    assert any(math.isclose(r.factor, factor, rel_tol=1e-6) for r in readings(name))


@pytest.mark.parametrize(
    ("name", "value", "kelvin"), [("degC", 36.6, 309.75), ("°C", 0, 273.15), ("degF", 212, 373.15)]
)
def test_temperatures_have_offsets(name: str, value: float, kelvin: float) -> None:
    (reading,) = readings(name)
    assert reading.factor * value + reading.offset == pytest.approx(kelvin)
    assert constants.convert_temperature(value, name[-1], "K") == pytest.approx(kelvin)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("m/s2", "m/s^2"), ("m/s2", "m/s²"), ("m/s2", "m.s-2"), ("m/s2", "m/s/s"),
        ("m/s2", "m*s^-2"), ("m/s2", "m/(s.s)"), ("N.m", "N·m"), ("N.m", "N*m"), ("N.m", "N m"),
        ("N.m", "Nm"), ("N.m", "J"), ("W", "J/s"), ("Pa", "N/m2"), ("V.A", "W"), ("Ohm", "V/A"),
        ("Ω", "Ohm"), ("µm", "um"), ("kg.m2", "N.m.s2"), ("rad/s", "rad.s-1"), ("S", "1/Ohm"),
        ("m**2", "m2"), ("F.V", "C"),
    ],
)  # fmt: skip
def test_spellings_of_one_unit(one: str, other: str) -> None:
    def close(a: float, b: float) -> bool:
        return math.isclose(a, b, rel_tol=1e-12)

    assert any(
        a.exponents == b.exponents and close(a.factor, b.factor)
        for a in readings(one)
        for b in readings(other)
    )


@pytest.mark.parametrize("name", ["", "Pedal", "m/", "(m", "m)", "foo.m", "m//s)"])
def test_what_is_not_understood_has_no_reading(name: str) -> None:
    assert readings(name) == ()


def test_ambiguous_names_have_every_reading() -> None:
    assert {r.exponents for r in readings("g")} == {exponents(kg=1), exponents(m=1, s=-2)}
    assert {r.exponents for r in readings("W/m2.K")} == {
        exponents(kg=1, s=-3, K=1),
        exponents(kg=1, s=-3, K=-1),
    }


@given(
    st.lists(
        st.tuples(
            st.sampled_from(sorted(BASE)),
            st.integers(-4, 4).filter(bool),
        ),
        min_size=1,
        max_size=5,
    )
)
def test_products_of_base_units_add_their_powers(parts: list[tuple[str, int]]) -> None:
    name = ".".join(f"{unit}{power}" for unit, power in parts)
    sums: dict[str, int] = {}
    for unit, power in parts:
        sums[unit] = sums.get(unit, 0) + power
    assert [(r.exponents, r.factor) for r in readings(name)] == [(exponents(**sums), 1.0)]


@given(st.text(max_size=12))
def test_any_name_may_be_asked_for(name: str) -> None:
    for reading in readings(name):
        assert reading.factor != 0
