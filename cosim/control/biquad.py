"""Second-order filters, one sample at a time."""

from __future__ import annotations

from sensor.channels import SAMPLE_RATE_HZ

Polynomial = tuple[float, float, float]  # factors of s^2, s and 1


class Biquad:
    """H(s) = numerator / denominator, discretised by the bilinear rule (trapezoidal integration).

    Transposed direct form II. Raises ValueError where the denominator has no constant: such a
    filter would keep a first sample for ever.
    """

    __slots__ = ("_a1", "_a2", "_b0", "_b1", "_b2", "_first", "_second")

    def __init__(
        self, numerator: Polynomial, denominator: Polynomial, rate: float = SAMPLE_RATE_HZ
    ) -> None:
        if denominator[2] == 0.0:
            raise ValueError("the denominator has no constant, so the filter has no settled state")
        b0, b1, b2 = _in_z(numerator, 2.0 * rate)
        a0, a1, a2 = _in_z(denominator, 2.0 * rate)
        self._b0, self._b1, self._b2 = b0 / a0, b1 / a0, b2 / a0
        self._a1, self._a2 = a1 / a0, a2 / a0
        self._first = self._second = 0.0

    def settle(self, x: float) -> None:
        """Take on the state after an input of `x` for ever."""
        gain = (self._b0 + self._b1 + self._b2) / (1.0 + self._a1 + self._a2)
        self._second = (self._b2 - self._a2 * gain) * x
        self._first = (gain - self._b0) * x

    def step(self, x: float) -> float:
        """Take one sample and return the output."""
        y = self._b0 * x + self._first
        self._first = self._b1 * x - self._a1 * y + self._second
        self._second = self._b2 * x - self._a2 * y
        return y


def _in_z(polynomial: Polynomial, k: float) -> Polynomial:
    """Put s = k (1 - 1/z) / (1 + 1/z) into a polynomial; factors of 1, 1/z and 1/z^2."""
    two, one, nought = polynomial
    two, one = two * k * k, one * k
    return two + one + nought, 2.0 * (nought - two), two - one + nought
