"""The best network on long and bad days: `make robustness`.

Writes docs/robustness.md and its pictures from the recorded hour and the evaluation's runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import click
import numpy as np
from bad_days import (
    ADAPTED,
    WINDOW,
    Fault,
    Hour,
    Slip,
    Start,
    faults,
    hour,
    slips,
    starts,
    trend,
)
from evaluated import NAMES, ROOT
from faults import FAULTS, LENGTH
from markdown_tables import fill, millimetres, table
from pictures import picture

from sensor.channels import CHANNEL_NAMES, SAMPLE_RATE_HZ
from sensor.dataset import read_runs

PAGE = ROOT / "docs" / "robustness.md"
PICTURES = ROOT / "docs" / "robustness"
FAULTY = {"straight_b_050_passive_1": "class B at 50 km/h", "mix_b_passive_1": "class B mix"}
STARTED = ("straight_b_050_passive_*", "mix_b_passive_*")
CONDITIONS = ("production", "ideal")
_STEP = WINDOW / SAMPLE_RATE_HZ


@click.command(help=__doc__)
@click.option("--data", required=True, type=click.Path(exists=True, path_type=Path),
              help="Runs of scenarios/datasets/evaluation.yaml.")  # fmt: skip
@click.option("--hour-data", required=True, type=click.Path(exists=True, path_type=Path),
              help="Runs of scenarios/datasets/hour.yaml.")  # fmt: skip
def main(data: Path, hour_data: Path) -> None:
    """Write the page."""
    whole, slipping = hour(hour_data), slips(hour_data)
    found = {
        (name, condition): faults(read_runs(data, [name])[0], condition)
        for name in FAULTY
        for condition in CONDITIONS
    }
    started = starts(read_runs(data, STARTED))
    draw_hour(PICTURES / "hour.svg", whole)
    draw_faults(PICTURES / "faults.svg", found["straight_b_050_passive_1", "production"])
    draw_slip(PICTURES / "slip.svg", slipping)
    draw_starts(PICTURES / "starts.svg", started)
    values = {
        "trends": trends(whole),
        "hour": hour_table(whole),
        "worst": "".join(worst(key, one) for key, one in found.items()),
        "faults": "".join(fault_table(key, one) for key, one in found.items()),
        "slip": slip_table(slipping),
        "starts": start_table(started),
    }
    fill(PAGE, values)


def trends(found: Hour) -> str:
    """Slopes over the hour with their standard errors."""
    rows = []
    for what, values, scale, unit in (
        ("RMSE over RMSE without drift", 100.0 * found.rmse / found.fresh, 1.0, "%"),
        ("RMSE over rms of the truth", 100.0 * found.rmse / found.truth, 1.0, "%"),
        ("mean error", found.mean, 1e3, "mm/s"),
        ("covered by the 90 % band", found.coverage, 1.0, "%"),
    ):
        slope, error = (scale * part for part in trend(values))
        mean, drifts = scale * float(values.mean()), abs(slope) > 2.2 * error
        verdict = "**a trend**" if drifts else "none"
        rows.append([what, f"{mean:.2f} {unit}", f"{slope:+.2f} ± {error:.2f} {unit}", verdict])
    return table(("figure", "mean of the parts", "change in the hour", "trend"), rows)


def hour_table(found: Hour) -> str:
    """The hour by five minutes."""
    rows = []
    for k in range(len(found.rmse)):
        speeds = [millimetres(part[k]) for part in (found.truth, found.fresh, found.rmse)]
        mean, share = f"{1e3 * found.mean[k]:+.2f}", f"{found.coverage[k]:.1f}"
        rows.append([f"{5 * k} to {5 * k + 5}", *speeds, mean, share])
    header = ("minutes", "truth rms", "RMSE without drift", "RMSE", "mean error", "covered, %")
    return table(header, rows)


def worst(key: tuple[str, str], found: Sequence[Fault]) -> str:
    """One line: the faults that cost most, and that take longest to recover from."""
    most = sorted(found, key=lambda one: -one.during / one.before)[:3]
    last = max(found, key=lambda one: one.recovery)
    names = ", ".join(
        f"`{one.channel}` {one.fault} ({one.during / one.before:.1f} times)" for one in most
    )
    share = 100.0 * np.mean([one.during < 1.5 * one.before for one in found])
    quick = 100.0 * np.mean([one.recovery <= 1.0 for one in found])
    return (
        f"- {FAULTY[key[0]]}, {key[1]}: {names}. Below 1.5 times the usual error: {share:.0f} % of "
        f"the faults. Recovered within 1 s: {quick:.0f} %; slowest `{last.channel}` {last.fault}, "
        f"{seconds(last.recovery)} s.\n"
    )


def fault_table(key: tuple[str, str], found: Sequence[Fault]) -> str:
    """Channel x fault."""
    by_place = {(one.channel, one.fault): one for one in found}
    rows = [
        [f"`{channel}`", *(_cell(by_place[channel, fault]) for fault in FAULTS)]
        for channel in CHANNEL_NAMES
    ]
    head = f"### {FAULTY[key[0]][0].upper()}{FAULTY[key[0]][1:]}, {key[1]}"
    usual = f"Usual error: {millimetres(found[0].before)} mm/s."
    return f"{head}\n\n{usual}\n\n{table(('channel', *FAULTS), rows)}\n"


def _cell(one: Fault) -> str:
    return (
        f"{millimetres(one.during)}; {millimetres(one.after)}; {seconds(one.recovery)}; "
        f"{one.coverage:.0f}; {one.growth:.1f}"
    )


def seconds(time: float) -> str:
    """Time with one digit; what is not over by the next fault is so much or more."""
    return f"{time:.1f}" if np.isfinite(time) else "> 14"


def slip_table(found: Sequence[Slip]) -> str:
    """Estimators while and after a wheel slips."""
    rows = []
    for one in found:
        over = np.flatnonzero(one.course > 1.5 * one.otherwise)
        back = 0.0 if not len(over) else (over[-1] + 1) * _STEP
        parts = [millimetres(part) for part in (one.otherwise, one.slipping, one.after)]
        share = "-" if one.coverage is None else f"{one.coverage:.0f}"
        name = NAMES[one.estimator]
        rows.append([name, one.condition, f"{one.share:.0f}", *parts, f"{back:.1f}", share])
    header = ("estimator", "condition", "slipping, % of the time", "no slip for 5 s", "slipping",
              "the second after", "recovered, s", "covered while slipping, %")  # fmt: skip
    return table(header, rows)


def start_table(found: Sequence[Start]) -> str:
    """Slow errors by time after the start."""
    header = ["error", *(f"{a:g} to {b:g} s" for a, b in ADAPTED), "all", "covered, %"]
    rows = [
        [one.what, *map(millimetres, one.rmse), millimetres(one.overall), f"{one.coverage:.1f}"]
        for one in found
    ]
    return table(header, rows)


def draw_hour(file: Path, found: Hour) -> None:
    """Error and coverage by five minutes."""
    time = 5.0 * np.arange(len(found.rmse)) + 2.5
    with picture(file, ncols=3, figsize=(8.6, 2.6)) as (_, panels):
        panels[0].plot(time, 1e3 * found.truth, "k:", label="rms of the truth")
        panels[0].plot(time, 1e3 * found.fresh, "o-", color="tab:gray", label="without drift")
        panels[0].plot(time, 1e3 * found.rmse, ".-", color="tab:red", label="sensors drifting")
        panels[0].set(ylabel="RMSE, mm/s", ylim=(0, None))
        panels[0].legend(fontsize=7)
        panels[1].plot(time, 1e3 * found.mean, ".-", color="tab:red")
        panels[1].set(ylabel="mean error, mm/s")
        panels[2].plot(time, found.coverage, ".-", color="tab:red")
        panels[2].axhspan(85, 95, color="tab:green", alpha=0.15)
        panels[2].set(ylabel="covered by the 90 % band, %", ylim=(50, 100))
        for axes in panels:
            axes.set(xlabel="time, min")


def draw_faults(file: Path, found: Sequence[Fault]) -> None:
    """Course of the error through the costliest channels' faults."""
    with picture(file, ncols=len(FAULTS), figsize=(8.6, 2.8), sharey=True) as (_, panels):
        for axes, name in zip(panels, FAULTS, strict=True):
            ones = sorted((f for f in found if f.fault == name), key=lambda f: -f.during)[:4]
            for one in ones:
                time = _STEP * (np.arange(one.course.shape[1]) + 0.5) - 1.0
                axes.plot(time, 1e3 * one.course[0], label=one.channel.removeprefix("Car."))
            axes.plot(time, 1e3 * ones[0].course[1], "k:", label="no fault")
            axes.axvspan(0, LENGTH / SAMPLE_RATE_HZ, color="tab:gray", alpha=0.15)
            axes.set(title=name, xlabel="time, s", yscale="log")
            axes.legend(fontsize=6)
        panels[0].set(ylabel="rms error in 0.2 s, mm/s")


def draw_slip(file: Path, found: Sequence[Slip]) -> None:
    """Course of the error after a slip."""
    colours = {"carried": "tab:red", "fir_residual_w64": "tab:orange"}
    with picture(file, ncols=2, figsize=(8.6, 2.6), sharey=True) as (_, panels):
        for axes, condition in zip(panels, CONDITIONS, strict=True):
            for one in (each for each in found if each.condition == condition):
                time = _STEP * (np.arange(len(one.course)) + 0.5)
                style = {"color": colours[one.estimator], "label": NAMES[one.estimator]}
                axes.plot(time, 1e3 * one.course, **style)
                axes.axhline(1e3 * one.otherwise, linestyle=":", color=style["color"])
            axes.set(title=condition, xlabel="time since the last slip, s", ylim=(0, None))
        panels[0].set(ylabel="rms error in 0.2 s, mm/s")
        panels[0].legend(fontsize=8)


def draw_starts(file: Path, found: Sequence[Start]) -> None:
    """Error over time after a start with some slow errors."""
    edges = np.array([ADAPTED[0][0], *(b for _, b in ADAPTED)], dtype=float)
    with picture(file, figsize=(6.4, 3.2)) as (_, axes):
        for one in found:
            if one.what.startswith(("nothing", "front left tyre +", "roll", "pitch", "a_z", "all")):
                axes.stairs(1e3 * one.rmse, edges, label=one.what, linewidth=1.3)
        axes.set(
            xscale="log", xlabel="time after the start, s", ylabel="RMSE, mm/s", ylim=(0, None)
        )
        axes.legend(fontsize=7)


if __name__ == "__main__":
    main()
