"""The closed loop: docs/closed-loop.md.

`make closed-loop`, or `python docs/measure/closed_loop.py`, runs scenarios/closed_loop in two
processes, drives the first scenario once per gain, and writes the page. The runs stay in
build/closed_loop, from where `--read` takes the figures without running anything.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from markdown_tables import fill, millimetres, percent, table
from ride_plane import draw_planes
from wrong_decisions import bounds_table

from cosim.assembly import assemble
from cosim.batch import find_scenarios, plan, run_all
from cosim.dataset import NoSensor
from cosim.metrics import figure
from cosim.scenario.load import load
from cosim.show import counter

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "scenarios" / "closed_loop"
RESULTS = ROOT / "build" / "closed_loop"
PICTURE = ROOT / "docs" / "closed-loop" / "plane.svg"
DRAWN = ("class_c_50", "class_b_80", "bumps_25", "hockenheim")
PROCESSES = 2
PAIRS = {  # scenario in both conditions: its title
    "class_b_80": "class B, 80 km/h",
    "class_c_50": "class C, 50 km/h",
    "bumps_25": "bumps, 25 km/h",
    "hockenheim": "lap of Hockenheim, class B",
    "double_lane_change": "double lane change",
}
OTHERS = ("laws", "fallback_lost", "fallback_uncertain")
CONDITIONS = ("ideal", "production")
SWEPT = FOLDER / "closed_loop_class_c_50.yaml"
GAINS = (1000.0, 2000.0, 3000.0, 3500.0, 4000.0, 6000.0, 8000.0, 12000.0)  # N s/m
BEST = "carried"

Runs = Mapping[str, Mapping[str, Any]]


def name_of(pair: str, condition: str) -> str:
    """Return the name of the scenario of a pair in a measurement condition."""
    end = "" if condition == "ideal" else f"_{condition}"
    return f"closed_loop_{pair}{end}"


# ---------------------------------------------------------------- runs


def run_scenarios() -> None:
    """Run the scenarios into `RESULTS`; ends the program where one cannot be run."""
    files, _ = find_scenarios([FOLDER])
    jobs = plan(files, RESULTS)
    ended, _ = run_all(jobs, PROCESSES, counter(len(jobs)))
    for one in ended:
        if one.metrics is None:
            raise SystemExit("\n".join(one.problems))


def read_results() -> dict[str, Runs]:
    """Return the figures of the runs of each scenario."""
    found = {}
    for file in sorted(RESULTS.glob("*/metrics.json")):
        metrics = json.loads(file.read_text("utf-8"))
        found[file.parent.name] = metrics["runs"]
    return found


# ---------------------------------------------------------------- tables


def rides(runs: Runs) -> str:
    """Return the table of the runs of a scenario."""
    header = ["run", "a_w, m/s²", "VDV, m/s^1.75", "deflection, mm", "tyre load, N", "roll, deg",
              "pitch, deg", "damper energy, kJ", "gain kept, %", "tyre load against truth's, %",
              "wrong, %", "RMSE, mm/s"]  # fmt: skip
    return table(header, (list(_ride(label, run)) for label, run in runs.items()))


def _ride(label: str, run: Mapping[str, Any]) -> Iterator[str]:
    comfort = run["comfort"]
    yield label.replace("_", " ")
    yield f"{comfort['weighted_acceleration_m_s2']:.3f}"
    yield f"{comfort['vibration_dose_m_s1_75']:.2f}"
    yield f"{1e3 * comfort['deflection_rms_m']:.2f}"
    yield f"{comfort['tyre_load_rms_n']:.0f}"
    yield f"{comfort['roll_rms_deg']:.3f}"
    yield f"{comfort['pitch_rms_deg']:.3f}"
    yield f"{1e-3 * comfort['damper_energy_j']:.2f}"
    yield percent(figure(run, "against_truth.gain_kept_percent"))
    load_change = figure(run, "against_truth.tyre_load_percent")
    yield "-" if load_change is None else f"{load_change:+.1f}"
    wrong = figure(run, "decisions.wrong_percent")
    yield "-" if wrong is None else f"{wrong:.2f}"
    yield millimetres(figure(run, "sensor.overall.rmse_m_s"))


def goals(found: Mapping[str, Runs], law: str) -> str:
    """Return the table of a law on the best estimate, against the goals."""
    header = ["scenario", *(f"{what}, {c}" for what in ("gain kept, %", "tyre load, %", "wrong, %")
                            for c in CONDITIONS)]  # fmt: skip
    paths = ("against_truth.gain_kept_percent", "against_truth.tyre_load_percent",
             "decisions.wrong_percent")  # fmt: skip
    rows = [
        ["goal", "at least 95", "at least 95", "at most +2", "at most +2", "at most 1", "at most 4"]
    ]
    for pair, title in PAIRS.items():
        runs = {c: found[name_of(pair, c)][f"{law}_{BEST}"] for c in CONDITIONS}
        row = [title]
        for path, sign in zip(paths, ("", "+", ""), strict=True):
            for condition in CONDITIONS:
                value = figure(runs[condition], path)
                row.append("-" if value is None else f"{value:{sign}.2f}")
        rows.append(row)
    return table(header, rows)


def against_plain(found: Mapping[str, Runs]) -> str:
    """Return the table of what the cautious law on the estimate makes of plain skyhook's comfort
    and tyre load on the truth.
    """
    columns = (
        ("comfort.weighted_acceleration_m_s2", "a_w"),
        ("comfort.tyre_load_rms_n", "tyre load"),
    )
    header = ["scenario", *(f"{title}, {c}, %" for _, title in columns for c in CONDITIONS)]
    rows = []
    for pair, scenario in PAIRS.items():
        row = [scenario]
        for path, _ in columns:
            for condition in CONDITIONS:
                runs = found[name_of(pair, condition)]
                plain = figure(runs["skyhook_truth"], path)
                value = figure(runs[f"cautious_skyhook_{BEST}"], path)
                assert plain
                assert value
                row.append(f"{100 * (value / plain - 1):+.1f}")
        rows.append(row)
    return table(header, rows)


def fallbacks(runs: Runs) -> str:
    """Return the table of a scenario whose estimate fails for a while."""
    header = ["run", "a_w, m/s²", "tyre load, N", "safe command active, % of time", "times",
              "largest step of force, N"]  # fmt: skip
    rows = []
    for label, run in runs.items():
        fallback = [figure(run, f"fallback.{what}")
                    for what in ("active_percent", "times", "force_step_n")]  # fmt: skip
        comfort = run["comfort"]
        row = [
            label,
            f"{comfort['weighted_acceleration_m_s2']:.3f}",
            f"{comfort['tyre_load_rms_n']:.0f}",
        ]
        rows.append([*row, *("-" if value is None else f"{value:.3g}" for value in fallback)])
    return table(header, rows)


# ---------------------------------------------------------------- the gain


def over_the_gain() -> str:
    """Return the table of skyhook on the truth over its gain, on the road of `SWEPT`."""
    header = ["controller", "a_w, m/s²", "deflection, mm", "tyre load, N"]
    return table(header, _sweep())


def _sweep() -> Iterator[Sequence[str]]:
    for name, settings in _swept():
        scenario = load(SWEPT, ["limits=[]", "goldens=[]", f"controllers=[{{{settings}}}]"])
        comfort = assemble(scenario, scenario.controllers[0], NoSensor()).run(None).comfort
        yield (
            name,
            f"{comfort['weighted_acceleration_m_s2']:.3f}",
            f"{1e3 * comfort['deflection_rms_m']:.2f}",
            f"{comfort['tyre_load_rms_n']:.0f}",
        )


def _swept() -> Iterator[tuple[str, str]]:
    yield "passive", "kind: passive"
    for command, name in ((0, "fixed soft"), (0.5, "fixed half"), (1, "fixed hard")):
        yield name, f"kind: fixed, command: {command}"
    for gain in GAINS:
        yield f"skyhook {gain:.0f} N s/m", f"kind: skyhook, feedback: truth, gain_ns_per_m: {gain}"


# ---------------------------------------------------------------- page


def write(found: Mapping[str, Runs]) -> None:
    """Write the page from the figures of the runs, by scenario."""
    values = {
        "goals_skyhook": goals(found, "skyhook"),
        "goals_cautious": goals(found, "cautious_skyhook"),
        "against_plain": against_plain(found),
        "bounds": bounds_table(),
        "gain": over_the_gain(),
        "laws": rides(found["closed_loop_laws"]),
    }
    for pair in PAIRS:
        for condition in CONDITIONS:
            values[f"{pair}_{condition}"] = rides(found[name_of(pair, condition)])
    for name in OTHERS[1:]:
        values[name] = fallbacks(found[f"closed_loop_{name}"])
    fill(ROOT / "docs" / "closed-loop.md", values)
    planes = {(PAIRS[p], c): found[name_of(p, c)] for c in CONDITIONS for p in DRAWN}
    draw_planes(PICTURE, planes)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--read", action="store_true", help="figures of the runs that are there")
    if not parser.parse_args().read:
        run_scenarios()
    write(read_results())
