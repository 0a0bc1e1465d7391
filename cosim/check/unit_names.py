"""What the name of a unit means, read on its own: `km/h` is 1/3.6 m/s, `mm` is 0.001 m.

A name may have several readings (`g` is a gram or standard gravity, `W/m2.K` may end below the
bar or beside it); all of them are returned, and none for a name that is not understood. Factors are
those of the SI brochure (9th edition, tables 2 to 8) and of NIST SP 811, appendix B.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import cache
from typing import Final

DIMENSIONS: Final = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
Exponents = tuple[int, ...]


@dataclass(frozen=True)
class Reading:
    """SI value = factor * value + offset; `exponents` in the order of `DIMENSIONS`."""

    factor: float
    exponents: Exponents
    offset: float = 0.0

    def times(self, other: Reading, power: int) -> Reading:
        """Return the product with another unit raised to a power; offsets are lost."""
        sums = (a + power * b for a, b in zip(self.exponents, other.exponents, strict=True))
        return Reading(self.factor * other.factor**power, tuple(sums))

    def same_kind(self, exponents: Exponents) -> bool:
        """Whether the exponents agree but for the radian, which many tools leave out."""
        return self.exponents[:7] == exponents[:7]


def _of(factor: float, offset: float = 0.0, **exponents: int) -> Reading:
    return Reading(factor, tuple(exponents.get(d, 0) for d in DIMENSIONS), offset)


_ONE: Final = _of(1.0)
_GRAVITY: Final = 9.80665
_PREFIXES: Final = {
    "q": 1e-30, "r": 1e-27, "y": 1e-24, "z": 1e-21, "a": 1e-18, "f": 1e-15, "p": 1e-12, "n": 1e-9,
    "u": 1e-6, "µ": 1e-6, "m": 1e-3, "c": 1e-2, "d": 1e-1, "da": 1e1, "h": 1e2, "k": 1e3,
    "M": 1e6, "G": 1e9, "T": 1e12, "P": 1e15, "E": 1e18, "Z": 1e21, "Y": 1e24,
}  # fmt: skip
_FORCE: Final = {"kg": 1, "m": 1, "s": -2}
_PRESSURE: Final = {"kg": 1, "m": -1, "s": -2}
_ENERGY: Final = {"kg": 1, "m": 2, "s": -2}
_POWER: Final = {"kg": 1, "m": 2, "s": -3}

# units that take SI prefixes; a name may mean several
_PREFIXABLE: Final[dict[str, tuple[Reading, ...]]] = {
    "g": (_of(1e-3, kg=1),), "m": (_of(1, m=1),), "s": (_of(1, s=1),), "A": (_of(1, A=1),),
    "K": (_of(1, K=1),), "mol": (_of(1, mol=1),), "cd": (_of(1, cd=1),), "rad": (_of(1, rad=1),),
    "sr": (_of(1, rad=2), _of(1)), "Hz": (_of(1, s=-1), _of(2 * math.pi, s=-1, rad=1)),
    "N": (_of(1, **_FORCE),), "Pa": (_of(1, **_PRESSURE),), "J": (_of(1, **_ENERGY),),
    "W": (_of(1, **_POWER),), "C": (_of(1, A=1, s=1), _of(1, 273.15, K=1)),
    "V": (_of(1, kg=1, m=2, s=-3, A=-1),), "F": (_of(1, kg=-1, m=-2, s=4, A=2),),
    "Ohm": (_of(1, kg=1, m=2, s=-3, A=-2),), "S": (_of(1, kg=-1, m=-2, s=3, A=2),),
    "Wb": (_of(1, kg=1, m=2, s=-2, A=-1),), "T": (_of(1, kg=1, s=-2, A=-1),),
    "H": (_of(1, kg=1, m=2, s=-2, A=-2),), "lm": (_of(1, cd=1), _of(1, cd=1, rad=2)),
    "lx": (_of(1, cd=1, m=-2), _of(1, cd=1, m=-2, rad=2)), "Bq": (_of(1, s=-1),),
    "Gy": (_of(1, m=2, s=-2),), "Sv": (_of(1, m=2, s=-2),), "kat": (_of(1, mol=1, s=-1),),
    "l": (_of(1e-3, m=3),), "L": (_of(1e-3, m=3),), "t": (_of(1e3, kg=1),),
    "bar": (_of(1e5, **_PRESSURE),), "eV": (_of(1.602176634e-19, **_ENERGY),),
    "cal": (_of(4.184, **_ENERGY), _of(4.1868, **_ENERGY)), "Wh": (_of(3600, **_ENERGY),),
    "Ah": (_of(3600, A=1, s=1),), "VA": (_of(1, **_POWER),), "var": (_of(1, **_POWER),),
    "Nm": (_of(1, **_ENERGY),), "Ns": (_of(1, kg=1, m=1, s=-1),),
    "Nms": (_of(1, kg=1, m=2, s=-1),), "Nmm": (_of(1e-3, **_ENERGY),),
}  # fmt: skip
_DEGREE: Final = _of(math.pi / 180, rad=1)
_TURN: Final = (_of(2 * math.pi, rad=1), _ONE)
_PER_MINUTE: Final = (_of(2 * math.pi / 60, s=-1, rad=1), _of(1 / 60, s=-1))
_FAHRENHEIT: Final = _of(5 / 9, 459.67 * 5 / 9, K=1)
_PLAIN: Final[dict[str, tuple[Reading, ...]]] = {
    "1": (_ONE,), "-": (_ONE,), "%": (_of(1e-2),), "percent": (_of(1e-2),), "‰": (_of(1e-3),),
    "ppm": (_of(1e-6),), "ppb": (_of(1e-9),),
    "min": (_of(60, s=1),), "h": (_of(3600, s=1),), "hr": (_of(3600, s=1),), "sec": (_of(1, s=1),),
    "d": (_of(86400, s=1),), "day": (_of(86400, s=1),), "wk": (_of(604800, s=1),),
    "a": (_of(365.25 * 86400, s=1), _of(365 * 86400, s=1), _of(100, m=2)),
    "yr": (_of(365.25 * 86400, s=1), _of(365 * 86400, s=1)), "ha": (_of(1e4, m=2),),
    "g": (_of(_GRAVITY, m=1, s=-2),), "G": (_of(_GRAVITY, m=1, s=-2), _of(1e-4, kg=1, s=-2, A=-1)),
    "deg": (_DEGREE,), "°": (_DEGREE,), "degree": (_DEGREE,), "degrees": (_DEGREE,),
    "radian": (_of(1, rad=1),), "meter": (_of(1, m=1),), "metre": (_of(1, m=1),),
    "second": (_of(1, s=1),), "kelvin": (_of(1, K=1),), "Kelvin": (_of(1, K=1),),
    "newton": (_of(1, **_FORCE),), "watt": (_of(1, **_POWER),), "volt": (
        _of(1, kg=1, m=2, s=-3, A=-1),), "ampere": (_of(1, A=1),),
    "pascal": (_of(1, **_PRESSURE),), "gon": (_of(math.pi / 200, rad=1),),
    "arcmin": (_of(math.pi / 10800, rad=1),), "arcsec": (_of(math.pi / 648000, rad=1),),
    "rev": _TURN, "turn": _TURN, "U": _TURN, "r": _TURN, "rpm": _PER_MINUTE, "rps": (
        _of(2 * math.pi, s=-1, rad=1), _of(1, s=-1)),
    "degC": (_of(1, 273.15, K=1),), "°C": (_of(1, 273.15, K=1),), "celsius": (_of(1, 273.15, K=1),),
    "degF": (_FAHRENHEIT,), "°F": (_FAHRENHEIT,), "degR": (_of(5 / 9, K=1),),
    "degRk": (_of(5 / 9, K=1),),
    "ft": (_of(0.3048, m=1),), "in": (_of(0.0254, m=1),), "inch": (_of(0.0254, m=1),),
    "yd": (_of(0.9144, m=1),), "mi": (_of(1609.344, m=1),), "mile": (_of(1609.344, m=1),),
    "nmi": (_of(1852, m=1),), "NM": (_of(1852, m=1),), "AU": (_of(149597870700, m=1),),
    "lb": (_of(0.45359237, kg=1),), "lbm": (_of(0.45359237, kg=1),), "oz": (
        _of(0.028349523125, kg=1),), "slug": (_of(14.59390, kg=1),),
    "lbf": (_of(4.4482216152605, **_FORCE),), "kgf": (_of(_GRAVITY, **_FORCE),),
    "kp": (_of(_GRAVITY, **_FORCE),), "dyn": (_of(1e-5, **_FORCE),),
    "psi": (_of(6894.757293168, **_PRESSURE),), "atm": (_of(101325, **_PRESSURE),),
    "at": (_of(98066.5, **_PRESSURE),), "Torr": (_of(101325 / 760, **_PRESSURE),),
    "mmHg": (_of(133.322387415, **_PRESSURE),), "inHg": (_of(3386.389, **_PRESSURE),),
    "hp": (_of(745.69987158227, **_POWER), _of(735.49875, **_POWER)),
    "PS": (_of(735.49875, **_POWER),), "BTU": (_of(1055.05585262, **_ENERGY),
        _of(1055.056, **_ENERGY)), "Btu": (_of(1055.05585262, **_ENERGY),),
    "erg": (_of(1e-7, **_ENERGY),), "kt": (_of(1852 / 3600, m=1, s=-1),),
    "kn": (_of(1852 / 3600, m=1, s=-1),), "knot": (_of(1852 / 3600, m=1, s=-1),),
    "kts": (_of(1852 / 3600, m=1, s=-1),), "mph": (_of(0.44704, m=1, s=-1),),
    "kph": (_of(1 / 3.6, m=1, s=-1),), "kmh": (_of(1 / 3.6, m=1, s=-1),),
    "mps": (_of(1, m=1, s=-1),), "fps": (_of(0.3048, m=1, s=-1),),
    "gal": (_of(3.785411784e-3, m=3),), "P": (_of(0.1, kg=1, m=-1, s=-1),),
    "cP": (_of(1e-3, kg=1, m=-1, s=-1),), "St": (_of(1e-4, m=2, s=-1),),
    "cSt": (_of(1e-6, m=2, s=-1),), "Gs": (_of(1e-4, kg=1, s=-2, A=-1),), "ohm": (
        _of(1, kg=1, m=2, s=-3, A=-2),),
}  # fmt: skip
_SUPERSCRIPTS: Final = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
_SPELLINGS: Final = {
    "Ω": "Ohm", "\u2126": "Ohm", "\u03bc": "µ", "·": ".", "⋅": ".", "\u00d7": ".", "**": "^",
    "\u00ba": "°", "deg C": "degC", "deg F": "degF",
}  # fmt: skip
_TOKENS: Final = re.compile(r"\s*(?:([()/])|([.*])|([^\s()/.*^\d+-]+|1|-(?!\d))(?:\^?([+-]?\d+))?)")


@cache
def readings(name: str) -> tuple[Reading, ...]:
    """Return all that a unit's name may mean; none if it is not understood."""
    text = name.strip()
    for old, new in _SPELLINGS.items():
        text = text.replace(old, new)
    text = text.translate(_SUPERSCRIPTS)
    if text in _PLAIN or not text:
        return (*_PLAIN.get(text, ()), *_prefixed(text))
    tokens = _tokens(text)
    if tokens is None:
        return ()
    every: list[Reading] = []
    for bar_reaches_on in (False, True):
        try:
            found, rest = _product(tokens, bar_reaches_on)
        except ValueError:
            return ()
        if rest:
            return ()
        every += [reading for reading in found if reading not in every]
    return tuple(every)


def _tokens(text: str) -> list[tuple[str, int]] | None:
    """Split into brackets, bars, and symbols with their powers; None for what does not split."""
    tokens, at = [], 0
    while at < len(text):
        match = _TOKENS.match(text, at)
        if match is None:
            return None
        bracket, _, symbol, power = match.groups()
        if bracket:
            tokens.append((bracket, 0))
        elif symbol:
            tokens.append((symbol, int(power) if power else 1))
        at = match.end()
    return tokens


def _product(
    tokens: list[tuple[str, int]], bar_reaches_on: bool
) -> tuple[list[Reading], list[tuple[str, int]]]:
    """Multiply up to the end or a closing bracket; a bar divides by what follows, or by all."""
    found, sign, fresh = [_ONE], 1, True
    while tokens and tokens[0][0] != ")":
        (symbol, power), tokens = tokens[0], tokens[1:]
        if symbol == "/":
            if not tokens:
                raise ValueError("nothing below the bar")
            sign, fresh = -1, True
            continue
        if symbol == "(":
            factors, tokens = _product(tokens, bar_reaches_on)
            if not tokens:
                raise ValueError("a bracket is open")
            tokens, power = tokens[1:], 1
        else:
            factors = list(_symbol(symbol))
        if not factors:
            raise ValueError(symbol)
        alone = fresh and not tokens and found == [_ONE] and sign * power == 1
        if not alone:
            factors = [a.times(b, sign * power) for a in found for b in factors]
        found, fresh = factors, False
        if not bar_reaches_on:
            sign = 1
    return found, tokens


@cache
def _symbol(symbol: str) -> tuple[Reading, ...]:
    return (*_PLAIN.get(symbol, ()), *_prefixed(symbol))


def _prefixed(symbol: str) -> tuple[Reading, ...]:
    found = list(_PREFIXABLE.get(symbol, ()))
    for prefix, factor in _PREFIXES.items():
        rest = symbol.removeprefix(prefix)
        if rest and rest != symbol:
            found += [
                Reading(factor * r.factor, r.exponents)
                for r in _PREFIXABLE.get(rest, ())
                if not r.offset
            ]
    return tuple(found)
