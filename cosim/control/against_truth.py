"""What is left of a law's gain when it acts on an estimate, beside the same law on the truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

from cosim.metrics import figure
from cosim.scenario.controllers import Controller, Law, Passive

LEAST_GAIN: Final = 0.02
"""Reduction of the weighted acceleration below which there is nothing to keep: a ratio of noise."""
_COMFORT: Final = "comfort.weighted_acceleration_m_s2"
_OWN: Final = {
    *("name", "feedback", "estimator", "network", "fmu"),
    *("fallback", "initial_command", "latency"),
}


def against_truth(
    controllers: Sequence[Controller], figures: Mapping[str, Mapping[str, Any]]
) -> dict[str, dict[str, float]]:
    """Return by the run's name, for each law on an estimate that a run of the same law on the truth
    and a passive run stand beside:

    gain_kept_percent: of the reduction of the weighted acceleration against the passive car that
    the truth brings, left out where that is below 2 %; tyre_load_percent and deflection_percent:
    change of the dynamic tyre load and of the deflection against those with the truth.
    """
    passive = next((c for c in controllers if isinstance(c, Passive)), None)
    laws = [c for c in controllers if isinstance(c, Law)]
    found = {}
    for law in laws:
        twin = _twin(law, laws)
        if passive is None or twin is None:
            continue
        runs = [figures[c.label] for c in (passive, twin, law)]
        found[law.label] = _figures(*runs)
    return found


def _twin(law: Law, laws: Sequence[Law]) -> Law | None:
    """Return the same law on the truth, if there is one and this is not it; of several that of the
    same latency.
    """
    if law.feedback == "truth":
        return None
    settings = law.model_dump(exclude=_OWN)
    on_truth = (other for other in laws if other.feedback == "truth")
    twins = [one for one in on_truth if one.model_dump(exclude=_OWN) == settings]
    return next((one for one in twins if one.latency == law.latency), twins[0] if twins else None)


def _figures(
    passive: Mapping[str, Any], truth: Mapping[str, Any], run: Mapping[str, Any]
) -> dict[str, float]:
    found = {}
    kept = _gain_kept(*(figure(one, _COMFORT) for one in (passive, truth, run)))
    if kept is not None:
        found["gain_kept_percent"] = kept
    for name, path in (("tyre_load", "tyre_load_rms_n"), ("deflection", "deflection_rms_m")):
        one, other = figure(truth, f"comfort.{path}"), figure(run, f"comfort.{path}")
        if one and other is not None:
            found[f"{name}_percent"] = 100.0 * (other / one - 1.0)
    return found


def _gain_kept(passive: float | None, truth: float | None, run: float | None) -> float | None:
    if passive is None or truth is None or run is None or truth > (1.0 - LEAST_GAIN) * passive:
        return None
    return 100.0 * (passive - run) / (passive - truth)
