"""What the dampers do while the estimate is not to be trusted: a fixed command, faded to and back.

An estimate that is not valid, or whose predicted deviation is too large, takes the law's command
away: what was commanded last fades to the safe one in a straight line, so that the damper's force
has no step; the step of a switch would be the whole distance between soft and hard. Back it goes
when the estimate has been trusted for a while without a break: from the safe command to whatever
the law commands then.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosim.control.sample import Sample
from cosim.loop import ControllerBlock
from sensor.channels import SAMPLE_RATE_HZ

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class FallbackParameters:
    """`command` 0 soft to 1 hard; `largest_deviation` [m/s] that is trusted at any wheel, None for
    any; `fade` [s] from one command to the other; `back_after` [s] of trust.
    """

    command: float
    largest_deviation: float | None = None
    fade: float = 0.5
    back_after: float = 1.0


class Fade:
    """The share of the safe command, from what is trusted: `share` 1 all safe, 0 all the law's.

    It begins with the safe command and goes back only from there, so that what is faded never
    changes on the way.
    """

    def __init__(self, fade: float, back_after: float, rate: float = SAMPLE_RATE_HZ) -> None:
        self._steps = max(round(fade * rate), 1)
        self._patience = round(back_after * rate)
        self._place = self._steps  # of the safe command, in steps of the fade
        self._trusted = 0
        self.returning = False

    @property
    def share(self) -> float:
        """Share of the safe command."""
        return self._place / self._steps

    def step(self, trusted: bool) -> float:
        """Take whether this sample's estimate is trusted; return the share."""
        self._trusted = self._trusted + 1 if trusted else 0
        if not trusted:
            self.returning = False
        elif self._trusted > self._patience and self._place == self._steps:
            self.returning = True
        self._place += -1 if self.returning else 1
        self._place = min(max(self._place, 0), self._steps)
        return self.share


class Fallback:
    """A controller behind a fallback; the controller follows every sample whether trusted or not,
    and is heard only while its estimate is trusted.
    """

    def __init__(self, controller: ControllerBlock, parameters: FallbackParameters) -> None:
        self.command = np.full(4, parameters.command)
        self._controller, self._parameters = controller, parameters
        self._fade = Fade(parameters.fade, parameters.back_after)
        self._law = np.full(4, parameters.command)

    def step(self, sample: Sample) -> Array:
        """Return the commands (4,), 0 soft to 1 hard, the same array every time."""
        chosen = self._controller.step(sample)
        share = self._fade.step(self._is_trusted(sample))
        if self._fade.returning:
            self._law[:] = chosen
        np.multiply(1.0 - share, self._law, out=self.command)
        self.command += share * self._parameters.command
        return self.command

    def _is_trusted(self, sample: Sample) -> bool:
        largest = self._parameters.largest_deviation
        if largest is None or not sample.valid:
            return sample.valid
        # NaN, where an estimator predicts none, is not larger than anything
        return not any(one > largest for one in sample.deviation.tolist())
