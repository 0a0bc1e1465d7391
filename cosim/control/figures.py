"""What a run tells of its controller: decisions against the truth, and how the fallback acted."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from cosim.control.damper_map import DamperMap
from cosim.control.fallback import Fade
from cosim.quantities import DAMPER_FORCE, DAMPER_SPEED, VALVE, Quantity
from cosim.scenario.controllers import Controller, Fallback, Law
from cosim.scenario.latency import SAMPLE_MS, Latency
from sensor.metrics.figures import SIGN_THRESHOLD

if TYPE_CHECKING:
    from cosim.recorder import Recorder

Array = npt.NDArray[np.float64]


def control_figures(
    controller: Controller, recorder: Recorder, dampers: DamperMap, latency: Latency
) -> Mapping[str, Any]:
    """Return the groups of figures `decisions` and `fallback`, empty where a run has none;
    `latency` is that of the run.
    """
    if not isinstance(controller, Law):
        return {"decisions": {}, "fallback": {}}
    safe, late = controller.fallback, round(latency.damper_ms / SAMPLE_MS)
    return {
        "decisions": decisions(controller, recorder),
        "fallback": {} if safe is None else fallback_figures(safe, recorder, dampers, late),
    }


def decisions(controller: Law, recorder: Recorder) -> dict[str, float]:
    """Return `wrong_percent`: of all wheels and valid samples in which the suspension moves faster
    than 20 mm/s, the share in which the law was told the wrong direction. That turns every law's
    decision over, since each chooses by the sign of something times the suspension velocity.
    """
    truth = recorder.group("truth")
    moving = np.abs(truth) > SIGN_THRESHOLD
    if controller.feedback == "truth":
        return {"wrong_percent": 0.0} if moving.any() else {}
    moving &= recorder.group("valid") > 0
    if not moving.any():
        return {}
    wrong = (recorder.group("estimate") * truth)[moving] <= 0.0
    return {"wrong_percent": 100.0 * float(np.mean(wrong))}


def fallback_figures(
    safe: Fallback, recorder: Recorder, dampers: DamperMap, late: int = 0
) -> dict[str, float]:
    """Return `active_percent`, the share of time without the law alone, `times` it was left after
    having been alone, and `force_step_n`, the largest step of a damper's force that it makes: while
    it fades to the safe command, and where it begins to fade back. From there on the law is heard
    again, whose own steps are not the fallback's. The dampers have a command `late` samples after
    it was given.
    """
    shares = fallback_shares(safe, recorder)
    active = shares > 0.0
    left = np.count_nonzero(~active[:-1] & active[1:])
    found = {"active_percent": 100.0 * float(active.mean()), "times": float(left)}
    steps = force_steps(recorder, dampers)
    before = np.concatenate([[1.0], shares[:-1]])
    acts = (shares > before) | ((before == 1.0) & (shares < 1.0))
    acts[1:] |= acts[:-1]  # the valve lags behind the command
    acts = np.concatenate([np.zeros(late, dtype=np.bool_), acts])  # until then the law's commands
    acts = acts[: len(steps)]  # what is commanded at t_k shows from t_k to t_k+1
    if acts.any() and np.isfinite(steps).all():
        found["force_step_n"] = float(np.abs(steps[acts]).max())
    return found


def blind(controllers: Sequence[Controller], records: Mapping[str, Recorder]) -> Iterator[str]:
    """Yield a sentence for each run whose fallback watches a deviation that is never told;
    `records` are by the name of the run.
    """
    for controller in controllers:
        safe = controller.fallback if isinstance(controller, Law) else None
        if safe is None or safe.largest_deviation_m_s is None:
            continue
        told = records[controller.label]
        valid = told.group("valid")[:, 0] > 0
        if valid.any() and np.isnan(told.group("deviation")[valid]).all():
            yield (
                f"{controller.label}: fallback.largest_deviation_m_s never acted: the sensor"
                " predicts no deviation"
            )


def fallback_shares(safe: Fallback, recorder: Recorder) -> Array:
    """Return the share of the safe command at each sample (rows,): what the block decided, from the
    same recorded validity and deviation.
    """
    largest = np.inf if safe.largest_deviation_m_s is None else safe.largest_deviation_m_s
    uncertain = (recorder.group("deviation") > largest).any(axis=1)
    trusted = (recorder.group("valid")[:, 0] > 0) & ~uncertain
    fade = Fade(safe.fade_s, safe.back_after_s)
    return np.array([fade.step(bool(one)) for one in trusted])


def force_steps(recorder: Recorder, dampers: DamperMap) -> Array:
    """Return what of each change of a damper's force (rows - 1, 4) [N] its command made: the force
    that the vehicle has at t_k less the one that its valve of t_k-1 would have had at the velocity
    of t_k. A force changes with its velocity all the time; a step is what comes on top.
    """
    force, speed, valve = (_recorded(recorder, q) for q in (DAMPER_FORCE, DAMPER_SPEED, VALVE))
    truth = recorder.group("truth")
    with np.errstate(invalid="ignore"):
        ratio = (speed * truth).sum(axis=0) / (truth * truth).sum(axis=0)  # of the damper's travel
    if not np.isfinite(ratio).all() or not np.isfinite(valve).all():
        return np.full((max(len(truth) - 1, 0), 4), np.nan)
    before = [
        [dampers.force(i, v, u) / ratio[i] for i, (v, u) in enumerate(zip(now, then, strict=True))]
        for now, then in zip(truth[1:].tolist(), valve[:-1].tolist(), strict=True)
    ]
    return np.asarray(force[1:] - np.array(before).reshape(-1, 4))


def _recorded(recorder: Recorder, quantities: tuple[Quantity, ...]) -> Array:
    return recorder.columns([quantity.name for quantity in quantities])
