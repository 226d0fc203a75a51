"""One seed, judged: a record of plain numbers and words that JSON can hold."""

from __future__ import annotations

import time
import traceback
import zlib
from typing import Any

import numpy as np

from population.candidate import Answer, ask
from population.coverage import intervals
from population.experiments import Experiment, draw_experiment, draw_frictionless
from population.rivals import best_fit, relative_error

FINDABLE = 0.05
"""An effect above this share of its joint's torque rms ought to be found."""
CLOCK_TOLERANCE, DELAY_TOLERANCE, GAIN_TOLERANCE = 0.1, 0.3, 0.1
"""How near to the truth a fault is found: relative, relative (or half a period), relative between joints."""
MESSAGE = 300
RIVALS = {"told": (True, False), "told_filtered": (True, True), "untold": (False, False)}
"""Whether each is told, and whether it filters the regressor."""
RIVAL_KEYS = tuple(key for rival in RIVALS for key in (rival, f"{rival}_cutoff"))


def judge(seed: int, noise: float | None = None, earlier: dict[str, Any] | None = None) -> dict[str, Any]:
    """The record of one seed; what goes wrong in casysid is in it under ``failure``.

    Args:
        seed: Of the experiment.
        noise: Of a robot without friction, as a share of the torque's rms; None for any experiment.
        earlier: Record of the same seed, from which the rivals' errors are taken if the experiment is still the same.
    """
    if noise is None:
        return judged(draw_experiment(seed), earlier)
    return judged(draw_frictionless(seed, noise), earlier) | {"noise": noise}


def fingerprint(experiment: Experiment) -> int:
    """Of the log and of what is judged, to nine digits, so that rounding on other machines does not count."""
    arrays = (experiment.recording.position, experiment.recording.torque, experiment.fresh_torque)
    return zlib.crc32(",".join(f"{np.linalg.norm(array):.9e}" for array in arrays).encode())


def rivals(experiment: Experiment) -> dict[str, float]:
    """Errors of all rivals, and their cut-offs."""
    found = {}
    for rival, (told, filtered) in RIVALS.items():
        fit = best_fit(experiment, told=told, filtered=filtered)
        found |= {rival: fit.error, f"{rival}_cutoff": fit.cutoff}
    return found


def judged(experiment: Experiment, earlier: dict[str, Any] | None = None) -> dict[str, Any]:
    """See :func:`judge`."""
    record = description(experiment)
    same = earlier is not None and earlier["fingerprint"] == record["fingerprint"]
    record |= {key: earlier[key] for key in RIVAL_KEYS} if earlier is not None and same else rivals(experiment)
    began = time.process_time()
    try:
        answer = ask(experiment.file, experiment.recording)
        record["seconds"] = answer.seconds
        record["error"] = relative_error(answer.torque(*experiment.fresh), experiment.fresh_torque)
        record["found"] = discoveries(experiment, answer)
        record["coverage"] = {} if experiment.faults.names else intervals(experiment, answer)
    except Exception as failure:  # of any kind: a failure is counted, and the others go on
        record["failure"] = f"{type(failure).__name__}: {str(failure)[:MESSAGE]}"
        record["traceback"] = traceback.format_exc()
        record.pop("error", None)
    record.setdefault("seconds", time.process_time() - began)
    return record


def description(experiment: Experiment) -> dict[str, Any]:
    """What kind of experiment it is."""
    truth, sampling, faults = experiment.truth, experiment.sampling, experiment.faults
    effects = truth.effects
    return {
        "seed": experiment.seed,
        "fingerprint": fingerprint(experiment),
        "joints": experiment.mechanism.robot.nv,
        "shape": experiment.mechanism.shape,
        "motion": experiment.family.kind,
        "rests": experiment.family.rests,
        "friction": "none" if truth.without_friction else "+".join(effects) or "ordinary",
        "effects": list(effects),
        "file": experiment.file_error,
        "faults": list(faults.names),
        "sampling": list(sampling.traits),
        "rows": len(experiment.recording),
        "rate": sampling.rate,
        "duration": sampling.duration,
        "contained": not faults.names and set(effects) <= {"asymmetry"},
    }


def effect_sizes(experiment: Experiment) -> dict[tuple[str, int], tuple[float, float]]:
    """Of every true effect and joint: its share in the joint's torque rms, and what of it ordinary friction leaves."""
    truth, state = experiment.truth, experiment.logged.motion.at(experiment.sampling.actual)
    rms = np.sqrt(np.mean(truth.torque(state) ** 2, axis=0))
    sizes = {}
    for effect in truth.effects:
        mine = [term for term in truth.terms if term.effect == effect]
        torque = sum(term.coefficient * term.column(state) for term in mine)
        for j in sorted({j for term in mine for j in term.joints}):
            v = state.v[:, j]
            usual = np.stack([v, np.tanh(v / (0.01 * v.std() + 1e-12)), np.ones(len(v)), state.a[:, j]], 1)
            left = torque[:, j] - usual @ np.linalg.lstsq(usual, torque[:, j], rcond=None)[0]
            sizes[effect, j] = tuple(float(np.sqrt(np.mean(x**2)) / rms[j]) for x in (torque[:, j], left))
    return sizes


def discoveries(experiment: Experiment, answer: Answer) -> dict[str, Any]:
    """True effects with their sizes and whether they were found; what was found and is not there; faults likewise."""
    sizes, claimed = effect_sizes(experiment), set(answer.effects)
    true = [
        {"effect": effect, "joint": j, "share": share, "unexplained": left, "found": (effect, j) in claimed}
        for (effect, j), (share, left) in sizes.items()
    ]
    false = [effect for effect, j in sorted(claimed) if (effect, j) not in sizes]
    return {"true": true, "false": false, **faults_found(experiment, answer)}


def faults_found(experiment: Experiment, answer: Answer) -> dict[str, Any]:
    """Of each fault ``true``, ``found`` (as large as it is, by a tolerance) and ``claimed``; and further complaints."""
    faults, period = experiment.faults, 1.0 / experiment.sampling.rate
    near = np.abs(answer.delay - faults.delay) <= np.maximum(DELAY_TOLERANCE * faults.delay, period / 2.0)
    gains = np.ones(len(faults.gains)) if answer.gains is None else answer.gains
    apart = np.log(gains / faults.gains)
    moving = ~experiment.family.at_rest
    found = {
        "clock": (abs(np.log(answer.clock * faults.clock)) < CLOCK_TOLERANCE, answer.clock != 1.0),
        "delay": (bool(near[moving].all()), bool(answer.delay.any())),
        "gains": (bool(np.abs(apart - apart.mean()).max() < GAIN_TOLERANCE), answer.gains is not None),
        "sign": (set(answer.negated) == set(np.flatnonzero(faults.signs < 0.0).tolist()), bool(answer.negated)),
    }
    return {
        "faults": {
            name: {
                "true": name in faults.names,
                "found": bool(right and claimed and name in faults.names),
                "claimed": claimed,
            }
            for name, (right, claimed) in found.items()
        },
        "clock": answer.clock,
        "delay": answer.delay.tolist(),
        "gains": None if answer.gains is None else answer.gains.tolist(),
        "quasi_static": answer.quasi_static,
        "complaints": list(answer.other_mistakes),
    }
