"""The network with carried state: features -> dense -> LSTM, one step per sample -> dense ->
velocities and their standard deviation.

A straight path from the features to the outputs carries what is linear; the LSTM adds the rest.
The logarithm of the standard deviation is learned beside it from the same hidden layer, without
pulling at it (detached), so that the velocities are those of the plain squared error.
"""

from dataclasses import dataclass, field

import torch
from torch import Tensor, nn

from sensor.carried.features import FeatureConfig

SCALE = 0.05  # m/s: what one unit of the output layer stands for at level 1
State = tuple[Tensor, Tensor]


@dataclass(frozen=True)
class CarriedConfig:
    """Shape of the network."""

    front: int = 64
    units: int = 128
    hidden: int = 64
    features: FeatureConfig = field(default_factory=FeatureConfig)

    @property
    def products(self) -> int:
        """Multiplications with weights per sample: the measure of its work."""
        n = self.features.count
        lstm = 4 * self.units * (self.front + self.units)
        return n * self.front + lstm + self.units * self.hidden + 8 * self.hidden + 4 * n


class CarriedNetwork(nn.Module):
    """Maps features and level (time, batch, count + 1) and a state to velocities and deviations
    [m/s].

    The buffers `mean`, `std` (count,) hold the normalisation, `calibration` (4,) the factors of the
    deviation found on validation runs. While `coarse`, the LSTM multiplies in bfloat16.
    """

    mean: Tensor
    std: Tensor
    calibration: Tensor

    def __init__(self, config: CarriedConfig | None = None) -> None:
        super().__init__()
        self.config = config = config or CarriedConfig()
        self.coarse = False
        count = config.features.count
        self.front = nn.Linear(count, config.front)
        self.lstm = nn.LSTM(config.front, config.units)
        self.hidden = nn.Linear(config.units, config.hidden)
        self.output = nn.Linear(config.hidden, 4)
        self.straight = nn.Linear(count, 4, bias=False)
        self.log_deviation = nn.Linear(config.hidden, 4)
        self.register_buffer("mean", torch.zeros(count))
        self.register_buffer("std", torch.ones(count))
        self.register_buffer("calibration", torch.ones(4))

    def forward(self, features: Tensor, state: State | None = None) -> tuple[Tensor, Tensor, State]:
        """Return velocities, deviations (time, batch, 4) [m/s] and the next state."""
        level = SCALE * features[..., -1:]
        x = (features[..., :-1] - self.mean) / self.std
        with torch.autocast("cpu", torch.bfloat16, enabled=self.coarse):
            ahead, state = self.lstm(torch.tanh(self.front(x)), state)
        if self.coarse:
            ahead, state = ahead.float(), (state[0].float(), state[1].float())
        hidden = torch.relu(self.hidden(ahead))
        velocity = level * (self.output(hidden) + self.straight(x))
        log_deviation = self.log_deviation(hidden.detach()).clamp(-6.0, 3.0)
        return velocity, level * torch.exp(log_deviation) * self.calibration, state
