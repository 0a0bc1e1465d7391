"""Time per sample of the networks in every run time, one thread, one process:
`make benchmark-network`, or with OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1
`python tests/benchmarks/bench_network.py [--write]`.

Every form sees the same samples and must give the same estimates to 1e-5 m/s. Rounds are
interleaved, so that all share the machine's good and bad moments. `--write` puts the tables into
docs/performance-network.md; OpenVINO and valgrind are used where they are installed.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Final

import torch
from network_c import CSensor, FmuByFmpy, c_forms, compiled, instructions
from network_forms import PLAIN, STREAMING, Form, Subject, forms, subject
from network_timing import COMMAND, Time, timed
from network_words import machine, memory_of

from cosim.pack.packing import pack
from cosim.sensor_fmu import FmuSensor
from sensor.carried.runtime import CarriedSensor
from sensor.estimators import MODELS

ROOT: Final = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "docs" / "measure"))
from markdown_tables import fill, table  # noqa: E402

SHAPES: Final = ((19, 167, 256), (51, 512, 512))
CARRIED: Final = MODELS / "carried_ideal.onnx"
BEST_C: Final = "C, "
THREADS: Final = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")


class Bench:
    """One folder with compiled library, networks and FMUs; what is measured with them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.library = compiled(folder)
        self.subjects = [subject(*shape, folder) for shape in SHAPES]
        self.fmus = {s.model: self._packed(s.model) for s in self.subjects}
        self.fmus[CARRIED] = self._packed(CARRIED)

    def _packed(self, model: Path) -> Path:
        return pack(model, self.folder / f"{model.stem}.fmu", fmi=3).path

    def all_forms(self, s: Subject) -> Iterator[Form]:
        """Yield a windowed network in every form."""
        yield from forms(s)
        yield from c_forms(self.library, s.model)
        fmpy = FmuByFmpy(self.fmus[s.model])
        yield Form("FMU, FMPy's functions", fmpy.take, lambda: fmpy.estimate)
        block = FmuSensor(self.fmus[s.model])
        yield Form("FMU, `cosim run`", _step(block.step), lambda: block.estimate)

    def carried_forms(self) -> Iterator[Form]:
        """Yield the shipped network with carried state."""
        sensor = CarriedSensor(CARRIED)
        yield Form("carried, ONNX Runtime", _step(sensor.step), lambda: sensor.estimate)
        for form in c_forms(self.library, CARRIED):
            yield Form(f"carried, {form.name}", form.take, form.estimate)
        fmu = FmuByFmpy(self.fmus[CARRIED])
        yield Form("carried, FMU, FMPy's functions", fmu.take, None)


def _step(step: Callable[..., bool]) -> Callable[..., bool]:
    return lambda sample: step(sample, COMMAND)


def main() -> None:
    """Measure and print the tables; with --write into the page."""
    if any(os.environ.get(name) != "1" for name in THREADS):
        sys.exit(f"set {'=1 '.join(THREADS)}=1: they are read before the first line of this")
    torch.set_num_threads(1)
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(Path(folder))
        times = {}
        for s in bench.subjects:
            times[s] = timed(list(bench.all_forms(s)), s.config.window)
        carried = timed(list(bench.carried_forms()), 50)
        values = {
            "machine": machine(),
            "small": _table(times[bench.subjects[0]]),
            "large": _table(times[bench.subjects[1]]),
            "carried": _table(carried, times[bench.subjects[0]][PLAIN]),
            "goals": _goals(list(times.values()), carried),
            "memory": _memory(bench),
            "instructions": _instructions(bench),
        }
    for name, value in values.items():
        print(f"{name}:\n{value}\n")
    if "--write" in sys.argv[1:]:
        fill(ROOT / "docs" / "performance-network.md", values)


def _table(times: dict[str, Time], plain: Time | None = None) -> str:
    base = (plain or times[PLAIN]).median
    rows = [
        (name, f"{t.median:.1f}", f"{t.p99:.1f}", f"{base / t.median:.2f}", t.off)
        for name, t in times.items()
    ]
    head = ("form", "median, us", "p99, us", f"times faster than {PLAIN}", "off torch, m/s")
    return table(head, rows)


def _fastest(times: dict[str, Time], prefix: str) -> tuple[str, float]:
    """Return the form with this beginning of a name whose median [us] is least."""
    found = [(t.median, name) for name, t in times.items() if name.startswith(prefix)]
    median, name = min(found)
    return name, median


def _goals(windowed: Sequence[dict[str, Time]], carried: dict[str, Time]) -> str:
    """The goals, which are ratios, and what was reached at either shape."""

    def both(ratio: Callable[[dict[str, Time]], float | None]) -> list[str]:
        found = [ratio(times) for times in windowed]
        return ["-" if value is None else f"{value:.2f}" for value in found]

    def faster(name: str) -> Callable[[dict[str, Time]], float | None]:
        return lambda t: t[PLAIN].median / t[name].median if name in t else None

    def over_floor(t: dict[str, Time]) -> float:
        return _fastest(t, BEST_C)[1] / _fastest(t, "sgemm")[1]

    def fmu(t: dict[str, Time]) -> float:
        return t["FMU, FMPy's functions"].median - _fastest(t, BEST_C)[1]

    def share(t: dict[str, Time]) -> float:
        return _fastest(carried, "carried, C")[1] / _fastest(t, BEST_C)[1]

    rows = [
        (f"{STREAMING}: faster than windowed", "3.5", *both(faster(STREAMING))),
        ("C with AVX-512: faster", "7", *both(faster("C, avx512"))),
        ("C with AVX2: faster", "4.5", *both(faster("C, avx2"))),
        ("C over the fastest sgemm of that shape", "at most 1.4", *both(over_floor)),
        ("FMU through FMPy over the C call, us", "at most 15", *both(fmu)),
        ("carried over windowed, both in C", "below 0.1", *both(share)),
    ]
    return table(("ratio of medians", "goal", *(_shape(*shape) for shape in SHAPES)), rows)


def _shape(window: int, units: int, hidden: int) -> str:
    return f"W = {window}, {units} units, {hidden} dense"


def _memory(bench: Bench) -> str:
    rows = []
    networks = [(_shape(*shape), s.model) for shape, s in zip(SHAPES, bench.subjects, strict=True)]
    for name, model in [*networks, ("carried", CARRIED)]:
        sensor = CSensor(bench.library, model)
        figures = (
            sensor.instance_bytes, sensor.network_bytes, bench.fmus[model].stat().st_size,
            memory_of(model),
        )  # fmt: skip
        rows.append((name, *(f"{figure / 1000:.0f}" for figure in figures)))
    head = ("network", "C, one instance", "C, weights", "FMU, file", "ONNX Runtime, one instance")
    return table(head, rows)


def _instructions(bench: Bench) -> str:
    if shutil.which("valgrind") is None:
        return "valgrind is not installed.\n"
    models: Iterable[tuple[str, Path]] = [
        *((_shape(*shape), s.model) for shape, s in zip(SHAPES, bench.subjects, strict=True)),
        ("carried", CARRIED),
    ]
    counts = {name: instructions(bench.folder, model) for name, model in models}
    names = list(dict.fromkeys(kernel for found in counts.values() for kernel in found))
    rows = [
        (name, *(f"{found[k]:,.0f}".replace(",", " ") for k in names))
        for name, found in counts.items()
    ]
    return table(("network", *names), rows)


if __name__ == "__main__":
    main()
