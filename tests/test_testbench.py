"""The five calls of a test bench: ours, and an adapter to another one, drive the same run."""

from __future__ import annotations

import inspect
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from loop_rig import write_scenario
from xil_bench import Port, ValueFactory, XilBench

from cosim.assembly import assemble
from cosim.quantities import (
    CHANNEL_QUANTITIES,
    INPUT_QUANTITIES,
    OUTPUT_QUANTITIES,
    RECORDED,
    TRUTH,
)
from cosim.run import execute
from cosim.scenario.load import load
from cosim.testbench import State

PATHS = {q.name: f"Model/{q.name}" for q in (*OUTPUT_QUANTITIES, *INPUT_QUANTITIES)}


def test_a_state_is_views_of_one_buffer() -> None:
    values = np.arange(float(len(OUTPUT_QUANTITIES)))
    state = State.over(values)
    n, m = len(CHANNEL_QUANTITIES), len(CHANNEL_QUANTITIES) + len(TRUTH)
    parts = (state.channels, state.truth, state.recorded)
    assert [part.tolist() for part in parts] == [
        values[:n].tolist(), values[n:m].tolist(), values[m:].tolist(),
    ]  # fmt: skip
    assert [OUTPUT_QUANTITIES[int(i)].name for i in state.pose] == ["Car.tx", "Car.ty", "Car.Yaw"]
    assert OUTPUT_QUANTITIES[int(state.stage[0])] in RECORDED
    values[0] = -5.0
    assert state.channels[0] == -5.0
    with pytest.raises(ValueError, match="a state has"):
        State.over(np.zeros(3))


def test_a_whole_run_over_another_bench(tmp_path: Path) -> None:
    """With a skyhook on the estimate in the loop: what is written acts, in the sample it should."""
    runs = "[{kind: skyhook, feedback: estimate, estimator: fir_w19}]"
    path = write_scenario(tmp_path, duration="1", surface="C", sections={"controllers": runs})
    scenario = load(path)
    ours = assemble(scenario, scenario.controllers[0])
    port = Port(ours.blocks.vehicle)
    bench = XilBench(port, ValueFactory(), "port.xml", PATHS)
    execute(scenario, tmp_path / "xil", assemble=partial(assemble, bench=bench))
    execute(scenario, tmp_path / "own")
    files = [(tmp_path / name / "signals.csv").read_bytes() for name in ("xil", "own")]
    assert files[0] == files[1]
    assert port.calls == [
        "LoadConfiguration", "Configure port.xml", "StartSimulation", "StopSimulation", "Dispose",
    ]  # fmt: skip


def test_the_page_shows_the_adapter_that_is_tested() -> None:
    page = Path(__file__).parents[1] / "docs" / "regression.md"
    assert f"```python\n{inspect.getsource(XilBench)}```" in page.read_text("utf-8")
