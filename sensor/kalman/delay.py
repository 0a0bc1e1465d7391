"""The road that the front wheels have met, until the rear ones meet it."""

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

_ROOM = 1024  # substeps until the line is copied back to its end


class DelayLine:
    """`taps` (2, m), newest first: the white noise behind the road under the front wheels, as (sum,
    difference), held over one substep each. It is found again by the way the car has come, so speed
    may change: of the last substep, `part` was of the tap `age` + 1, the rest of the tap `age`,
    counted before that substep.
    """

    def __init__(self, length: int, wheelbase: float) -> None:
        self._length, self._wheelbase = length, wheelbase
        self._line = np.zeros((2, length + _ROOM))
        self._ends = [0.0] * (length + _ROOM)  # way at the end of each tap [m]
        self._rear, self._older = np.zeros(2), np.zeros(2)
        self.reset()

    def reset(self) -> None:
        """Forget the road."""
        self._line.fill(0.0)
        self._ends[:] = [0.0] * len(self._ends)
        self._place, self.age, self.part = _ROOM, 0, 0.0
        self.taps = self._line[:, self._place :]

    def step(self, way: float) -> Array:
        """Go on by `way` [m] in one substep; return the road that the rear wheels meet in it (2,),
        the same array every time. A road older than the line counts as even.
        """
        last, ends, place = self._length - 1, self._ends, self._place
        come = ends[place] + way
        met = come - self._wheelbase
        age = min(self.age + 1, last)
        while age > 0 and ends[place + age] < met:
            age -= 1
        while age < last and ends[place + age + 1] >= met:
            age += 1
        self.age = age
        if age < last and ends[place + age] >= met:
            self.part = (ends[place + age] - met) / (ends[place + age] - ends[place + age + 1])
            np.multiply(self.taps[:, age], 1.0 - self.part, out=self._rear)
            np.multiply(self.taps[:, age + 1], self.part, out=self._older)
            self._rear += self._older
        else:
            self.age, self.part = last, 0.0
            self._rear.fill(0.0)
        self._advance(come)
        return self._rear

    def _advance(self, come: float) -> None:
        if self._place == 0:
            self._line[:, _ROOM:] = self.taps
            self._ends[_ROOM:] = self._ends[: self._length]
            self._place = _ROOM
        self._place -= 1
        self.taps = self._line[:, self._place : self._place + self._length]
        self.taps[:, 0] = 0.0
        self._ends[self._place] = come
