"""Closed loops, coupled joints and loose things of an MJCF: what may be left out, and what has to be locked first."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from casysid.errors import RobotError
from casysid.robot.locking import lock_words
from casysid.robot.mjcf_tree import body_names, joint_names

_KINDS = {
    int(mujoco.mjtEq.mjEQ_CONNECT): "connect",
    int(mujoco.mjtEq.mjEQ_WELD): "weld",
    int(mujoco.mjtEq.mjEQ_JOINT): "joint",
    int(mujoco.mjtEq.mjEQ_TENDON): "tendon",
}


def loose_bodies(compiled: Any) -> frozenset[int]:
    """Bodies of a scene beside the robot: trees that float, without a joint of their own, where another has joints."""
    own = dict.fromkeys((int(root) for root in compiled.body_rootid[1:]), 0)
    for j in range(compiled.njnt):
        own[int(compiled.body_rootid[compiled.jnt_bodyid[j]])] += 1
    floating = {
        int(compiled.jnt_bodyid[j])
        for j in range(compiled.njnt)
        if compiled.jnt_type[j] == mujoco.mjtJoint.mjJNT_FREE and own[int(compiled.jnt_bodyid[j])] == 1
    }
    if not any(count for root, count in own.items() if root not in floating):
        return frozenset()
    return frozenset(b for b in range(1, compiled.nbody) if int(compiled.body_rootid[b]) in floating)


def check_loops(compiled: Any, locked: Collection[str], loose: Collection[int], path: Path) -> list[str]:
    """What of the equality constraints is left out, in words; empty when nothing is.

    A constraint between bodies that cannot move against each other asks for nothing.

    Raises:
        RobotError: Active constraints couple bodies, joints or tendons that move; all of them are named.
    """
    left_out, faults, to_lock = [], [], dict[str, float]()
    bodies, joints = body_names(compiled), joint_names(compiled)
    for k in range(compiled.neq):
        kind = _KINDS.get(int(compiled.eq_type[k]))
        if kind is None or not compiled.eq_active0[k]:
            continue
        named = f"<{kind}>" + (f" '{compiled.equality(k).name}'" if compiled.equality(k).name else "")
        if kind in ("connect", "weld"):
            ends = _bodies_of(compiled, k)
            if any(b in loose for b in ends):
                continue
            drawn = [bodies[b] for b in ends if compiled.body_mocapid[b] < 0]
            if len(drawn) == 1:
                left_out.append(f"equality constraint {named} that draws body '{drawn[0]}' to a mocap body")
                continue
            moving = [j for j in _joints_between(compiled, *ends) if joints[j] not in locked]
            where = _between(compiled, k)
        else:
            coupled = _coupled_joints(compiled, k, kind)
            moving = [j for j in coupled if joints[j] not in locked]
            moving = moving[:1] if kind == "joint" and joints[coupled[0]] not in locked else moving * (kind != "joint")
            where = " of " + " and ".join(f"joint '{joints[j]}'" for j in coupled) if kind == "joint" else ""
        if moving:
            faults.append(f"equality constraint {named}{where}")
            to_lock |= {joints[j]: _rest(compiled, j) for j in moving}
    if faults:
        raise RobotError(
            f"{path}: {'; '.join(faults)}: closed loops and coupled joints are not supported; "
            f"lock what moves in them ({lock_words(to_lock)}), or remove the constraint if the mechanism is a tree "
            "without it"
        )
    return left_out


def _between(compiled: Any, k: int) -> str:
    """The bodies or sites of a constraint, by name."""
    on_bodies = compiled.eq_objtype[k] == mujoco.mjtObj.mjOBJ_BODY
    names = body_names(compiled) if on_bodies else [compiled.site(s).name for s in range(compiled.nsite)]
    first, second = names[compiled.eq_obj1id[k]], names[compiled.eq_obj2id[k]]
    return f" of {'bodies' if on_bodies else 'sites'} '{first}' and '{second}'"


def _bodies_of(compiled: Any, k: int) -> tuple[int, int]:
    ends = int(compiled.eq_obj1id[k]), int(compiled.eq_obj2id[k])
    if compiled.eq_objtype[k] == mujoco.mjtObj.mjOBJ_BODY:
        return ends
    return int(compiled.site_bodyid[ends[0]]), int(compiled.site_bodyid[ends[1]])


def _joints_between(compiled: Any, first: int, second: int) -> list[int]:
    """Joints on the way from one body to the other, in the order of the tree."""
    ways = [set(_upwards(compiled, body)) for body in (first, second)]
    return sorted(
        j
        for body in ways[0] ^ ways[1]
        for j in range(compiled.body_jntadr[body], compiled.body_jntadr[body] + compiled.body_jntnum[body])
    )


def _upwards(compiled: Any, body: int) -> Iterator[int]:
    while body > 0:
        yield body
        body = int(compiled.body_parentid[body])


def _coupled_joints(compiled: Any, k: int, kind: str) -> list[int]:
    """Joints of a constraint of joints, or of those of its tendons."""
    ends = [int(end) for end in (compiled.eq_obj1id[k], compiled.eq_obj2id[k]) if end >= 0]
    if kind == "joint":
        return ends
    wraps = [range(compiled.tendon_adr[t], compiled.tendon_adr[t] + compiled.tendon_num[t]) for t in ends]
    found = []
    for w in (w for wrap in wraps for w in wrap):
        if compiled.wrap_type[w] == mujoco.mjtWrap.mjWRAP_JOINT:
            found.append(int(compiled.wrap_objid[w]))
        elif compiled.wrap_type[w] == mujoco.mjtWrap.mjWRAP_SITE:
            found += _joints_between(compiled, int(compiled.site_bodyid[compiled.wrap_objid[w]]), 0)
    return list(dict.fromkeys(found))


def _rest(compiled: Any, j: int) -> float:
    """The position in which the file shows a joint, within its range."""
    rest = float(compiled.qpos0[compiled.jnt_qposadr[j]])
    return float(np.clip(rest, *compiled.jnt_range[j])) if compiled.jnt_limited[j] else rest
