"""The paper's network: window of W samples x 14 channels -> BiLSTM -> its output at the last sample
-> two dense layers.

W = 19, 167 units per direction, 256 hidden units with ReLU and dropout 0.5, 4 outputs (section 3.2
of the paper).

The tap is the BiLSTM's output **at the last sample of the window**. There the backward direction,
which reads the window from its end, has consumed one sample only: its output is one cell evaluation
from zero state. Its other W - 1 steps and its recurrent weights never reach the output, and the
forget gate has nothing to forget, so neither exists here. This is exact for this tap only: for a
tap at an earlier sample, or for the "final state" that some frameworks return instead (there the
backward direction has read the whole window), the full backward pass would be needed.

Gates are ordered as in torch: input, forget, cell, output.
"""

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional

from sensor.residual_matrices import ResidualMatrices

TAP = (
    "BiLSTM output at the last sample of the window; the backward direction is one cell evaluation "
    "from zero state, which is exact for this tap only"
)

_BLOCK = 8


@dataclass(frozen=True)
class NetworkConfig:
    """Shape of the network; the defaults are the paper's.

    With `residual` the network itself replaces the four wheel speeds by their residuals
    (`sensor.features`) before it standardises.
    """

    window: int = 19
    channels: int = 14
    units: int = 167
    hidden: int = 256
    outputs: int = 4
    dropout: float = 0.5
    residual: bool = False


class BiLstmNetwork(nn.Module):
    """The network, between measured windows and suspension velocities in SI units.

    The buffers `input_mean`, `input_std` (14,), `output_mean`, `output_std` (4,) hold the
    normalisation.
    """

    input_mean: Tensor
    input_std: Tensor
    output_mean: Tensor
    output_std: Tensor

    def __init__(self, config: NetworkConfig | None = None) -> None:
        super().__init__()
        self.config = config = config or NetworkConfig()
        self.forward_lstm = nn.LSTM(config.channels, config.units, batch_first=True)
        self.backward_cell = nn.Linear(
            config.channels, 3 * config.units
        )  # input, cell and output gates
        self.dense = nn.Linear(2 * config.units, config.hidden)
        self.dropout = nn.Dropout(config.dropout)
        self.output = nn.Linear(config.hidden, config.outputs)
        self.register_buffer("input_mean", torch.zeros(config.channels))
        self.register_buffer("input_std", torch.ones(config.channels))
        self.register_buffer("output_mean", torch.zeros(config.outputs))
        self.register_buffer("output_std", torch.ones(config.outputs))
        self._draw_backward_cell()

    def _draw_backward_cell(self) -> None:
        """Draw the backward cell as torch draws an LSTM, whose bias is the sum of two draws."""
        bound = self.config.units**-0.5
        nn.init.uniform_(self.backward_cell.weight, -bound, bound)
        with torch.no_grad():
            self.backward_cell.bias.uniform_(-bound, bound).add_(
                torch.empty_like(self.backward_cell.bias).uniform_(-bound, bound)
            )

    def forward(self, measured: Tensor) -> Tensor:
        """Map windows (batch, W, 14) in the channels' units to velocities (batch, 4) in m/s."""
        seen = with_residuals(measured) if self.config.residual else measured
        standardised = self.standardised((seen - self.input_mean) / self.input_std)
        return standardised * self.output_std + self.output_mean

    def standardised(self, windows: Tensor) -> Tensor:
        """Map standardised windows (batch, W, 14) to standardised velocities (batch, 4)."""
        features = self.features(windows)
        return self.output(self.dropout(torch.relu(self.dense(features))))  # type: ignore[no-any-return]

    def features(self, windows: Tensor) -> Tensor:
        """Return the BiLSTM's output at the last sample: (batch, 2 x units), forward half first."""
        ahead = self._ahead(windows)
        gate, candidate, gate_out = self.backward_cell(windows[:, -1]).chunk(3, dim=1)
        back = torch.sigmoid(gate_out) * torch.tanh(torch.sigmoid(gate) * torch.tanh(candidate))
        return torch.cat([ahead, back], dim=1)

    def _ahead(self, windows: Tensor) -> Tensor:
        """Return the forward direction's output at the last sample (batch, units).

        In bfloat16 with units that never leave zero to fill up the last eight: the matrix kernels
        are twice as slow on other sizes (275 against 125 us per window of the paper's network).
        """
        missing = -self.config.units % _BLOCK
        if not (missing and torch.is_autocast_enabled("cpu")):
            return self.forward_lstm(windows)[0][:, -1]  # type: ignore[no-any-return]
        parameters = []
        for name, values in self.forward_lstm.named_parameters():
            by_gate = values.reshape(4, self.config.units, -1)
            columns = missing if name.startswith("weight_hh") else 0
            filled = functional.pad(by_gate, (0, columns, 0, missing)).flatten(0, 1)
            parameters.append(filled.squeeze(1) if name.startswith("bias") else filled)
        zero = windows.new_zeros(1, len(windows), self.config.units + missing)
        states = torch.lstm(
            windows, (zero, zero), parameters, True, 1, 0.0, self.training, False, True
        )[0]
        return states[:, -1, : self.config.units]

    @torch.no_grad()
    def load_bidirectional(self, lstm: nn.LSTM) -> None:
        """Take over the weights of a `torch.nn.LSTM(14, units, bidirectional=True)`.

        Its backward direction's recurrent weights and forget gate drop out.
        """
        given = dict(lstm.named_parameters())
        for name, parameter in self.forward_lstm.named_parameters():
            parameter.copy_(given[name])
        keep = [0, 2, 3]  # no forget gate
        bias = given["bias_ih_l0_reverse"] + given["bias_hh_l0_reverse"]
        weight = given["weight_ih_l0_reverse"].reshape(4, self.config.units, -1)
        bias = bias.reshape(4, self.config.units)
        self.backward_cell.weight.copy_(weight[keep].flatten(0, 1))
        self.backward_cell.bias.copy_(bias[keep].flatten())


def with_residuals(measured: Tensor) -> Tensor:
    """Return measured windows (batch, W, 14) with the wheel speeds replaced by their residuals."""
    matrices = ResidualMatrices.of()
    wheels, driving, steering, slip, rolling, spread, others = (
        torch.from_numpy(matrix)
        for matrix in (
            matrices.wheels,
            matrices.driving,
            matrices.steering,
            matrices.slip,
            matrices.rolling,
            matrices.spread,
            matrices.others,
        )
    )
    x = measured.double()
    driven = (x @ driving) / torch.cos(x @ steering) * (x @ slip + rolling)
    residual = (x @ wheels - driven).clamp(-matrices.limit, matrices.limit)
    return (x * others + residual @ spread).to(measured.dtype)
