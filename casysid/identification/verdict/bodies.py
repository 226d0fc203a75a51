"""Whether bodies can have what was found, and whether it is the data's."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from casysid.arrays import Array
from casysid.estimation import Status
from casysid.identification.result import IdentificationResult
from casysid.identification.verdict.criteria import Criterion, Word, names
from casysid.inertia import mass_properties

HEAVIEST_ROTOR = 100.0
"""Rotor inertia over the largest that the links put on a joint of the robot: gears of 1:100 with rotors of a hundredth
of a link's radius of gyration come to one."""
UNSEEN = 0.5
"""Share of the mechanism's parameters that the recordings may not show."""
SEEN = 0.5
"""Share of a body's parameters that the data decided, beyond which its size is judged."""


def body_criteria(result: IdentificationResult) -> Iterator[Criterion]:
    """Of solver, signs and consistency, sizes, and what the file decided."""
    yield _fatal("solver", result.status is Status.DEGENERATE, f"The estimator found nothing: {result.status.value}.")
    links = result.inconsistent_links
    impossible = f"No body can have the inertia of {names(links)}: the pseudo-inertia is not positive definite."
    yield _fatal("consistency", bool(links), impossible)
    negative = result.negative_drive_parameters
    yield _fatal("signs", bool(negative), f"Negative where physics allows none: {names(negative)}.")
    yield from _sizes(result)
    lacking = 1.0 - min(result.excited.rank / max(result.structural.rank, 1), 1.0)
    yield Criterion(
        name="decided by the file",
        value=lacking,
        limit=UNSEEN,
        word=Word.DOUBTFUL,
        reason=f"The recordings show {result.excited.rank} of the {result.structural.rank} base parameters, the file "
        "decided the others: usable for motions like those recorded. Move the joints more, and differently.",
        origin="the greater part is to be measured",
    )


def _sizes(result: IdentificationResult) -> Iterator[Criterion]:
    reach = sum(float(np.linalg.norm(joint.placement.translation)) for joint in result.robot.joints)
    bodies = result.inertial_parameters.reshape(-1, 10)
    found = mass_properties(bodies)
    outside = []
    for k, link in enumerate(result.robot.links):
        shares = result.sources.by_data[10 * k : 10 * k + 10]
        mass = float(found.mass[k])
        if not (shares[0] > SEEN and shares[[4, 6, 9]].min() > SEEN and mass > 0.0):
            continue
        gyration = np.sqrt(max(float(np.trace(found.inertia[k])) / (2.0 * mass), 0.0))
        outside.append((max(float(gyration), float(np.linalg.norm(found.center_of_mass[k]))), link))
    furthest, link = max(outside, default=(0.0, ""))
    yield Criterion(
        name="size of bodies",
        value=furthest / reach if reach > 0.0 else 0.0,
        limit=1.0,
        word=Word.DOUBTFUL,
        reason=f"The mass of {link} lies {furthest:.2g} m from its joint, further than the robot reaches "
        f"({reach:.2g} m): something else is explained by it.",
        origin="no body has its mass further out than the robot reaches",
    )
    rotors = result.drive_vector("armature")
    largest = max(
        _heaviest(bodies, reach), _heaviest(result.regressor.robot.inertial_parameters.reshape(-1, 10), reach)
    )
    worst = int(np.argmax(rotors)) if len(rotors) else 0
    heaviest = float(rotors[worst]) if len(rotors) else 0.0
    yield Criterion(
        name="size of rotors",
        joint="" if heaviest <= HEAVIEST_ROTOR * largest else result.robot.dofs[worst],
        value=heaviest / largest if largest > 0.0 else 0.0,
        limit=HEAVIEST_ROTOR,
        word=Word.REJECTED,
        reason=f"The rotor of {result.robot.dofs[worst]} has {heaviest:.3g} kg m², no drive has: the joint hardly "
        "moved, or its columns are wrong. Move it, or leave it out with --lock.",
        origin="gears of 1:100 with rotors a hundredth of the links' size",
    )


def _heaviest(bodies: Array, reach: float) -> float:
    """What all links together can put on one joint: their mass at the reach, and their own inertias [kg m²]."""
    return float(np.abs(bodies[:, 0]).sum() * reach**2 + np.abs(bodies[:, [4, 6, 9]]).max(axis=1).sum())


def _fatal(name: str, broken: bool, reason: str) -> Criterion:
    return Criterion(
        name=name, value=float(broken), limit=0.0, word=Word.REJECTED, reason=reason if broken else "", origin="physics"
    )
