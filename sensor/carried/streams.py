"""Runs side by side for truncated backpropagation: each stream plays run after run, and its state
starts anew where a run does.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Float32 = npt.NDArray[np.float32]


@dataclass(frozen=True)
class Sequence4:
    """One run ready for training: `features` (n, count), `truth` (n, 4) [m/s], and what its squared
    error counts.
    """

    features: Float32
    truth: Float32
    weight: float


@dataclass(frozen=True)
class Chunk:
    """`features` (time, streams, count), `truth` and `weight` (time, streams, 4 and 1); `starts`
    (streams,) is 0 where a run begins, else 1.
    """

    features: Float32
    truth: Float32
    weight: Float32
    starts: Float32


@dataclass(frozen=True)
class Streams:
    """How runs are laid side by side."""

    count: int
    chunk: int
    warm_up: int

    def chunks(self, runs: Sequence[Sequence4], random: np.random.Generator) -> Iterator[Chunk]:
        """Yield every run once, in random order, cut into chunks; what is left over at the end of a
        run, and its first `warm_up` samples, has no weight.

        The streams end together: the longest decides, shorter ones are filled with nothing.
        """
        rows = self._rows(runs, random)
        length = max(len(row) for row in rows)
        width = runs[0].features.shape[1]
        for place in range(length):
            shape = (self.chunk, self.count)
            features = np.zeros((*shape, width), dtype=np.float32)
            truth = np.zeros((*shape, 4), dtype=np.float32)
            weight = np.zeros((*shape, 1), dtype=np.float32)
            starts = np.ones(self.count, dtype=np.float32)
            for stream, row in enumerate(rows):
                if place >= len(row):
                    continue
                run, first = row[place]
                part = slice(first, min(first + self.chunk, len(run.features)))
                n = part.stop - part.start
                features[:n, stream] = run.features[part]
                truth[:n, stream] = run.truth[part]
                weight[:n, stream] = run.weight
                if first == 0:
                    starts[stream] = 0.0
                    weight[: self.warm_up, stream] = 0.0
            yield Chunk(features, truth, weight, starts)

    def _rows(
        self, runs: Sequence[Sequence4], random: np.random.Generator
    ) -> list[list[tuple[Sequence4, int]]]:
        """Deal the runs, longest first where it matters, to the stream that is shortest so far."""
        rows: list[list[tuple[Sequence4, int]]] = [[] for _ in range(self.count)]
        order = sorted(random.permutation(len(runs)), key=lambda i: -len(runs[i].features) // 2000)
        for index in order:
            row = min(rows, key=len)
            run = runs[index]
            row.extend((run, first) for first in range(0, len(run.features), self.chunk))
        for row in rows:
            _shuffle_runs(row, random)
        return rows


def _shuffle_runs(row: list[tuple[Sequence4, int]], random: np.random.Generator) -> None:
    """Play the runs of a stream in random order, each from its start."""
    begins = [i for i, (_, first) in enumerate(row) if first == 0]
    parts = [row[a:b] for a, b in zip(begins, [*begins[1:], len(row)], strict=True)]
    row[:] = [item for i in random.permutation(len(parts)) for item in parts[i]]
