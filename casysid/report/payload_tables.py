"""The tables of ``casysid payload``."""

from __future__ import annotations

from casysid.payload import Payload, PayloadResult
from casysid.report.tables import Table, number, percent

INERTIA = ("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")
LENGTHS, MOMENTS = "mm", "kg cm²"


def payload_tables(result: PayloadResult) -> list[tuple[str, Table]]:
    """One table for each payload: its quantities with standard errors and 95 % intervals."""
    return [(f"{one.name}, held by {one.link}", _quantities(one)) for one in result.payloads]


def _quantities(one: Payload) -> Table:
    low, high = one.uncertainty.link_interval()
    names = ["mass [kg]"]
    names += [f"centre of mass {axis} [{LENGTHS}]" for axis in "xyz"]
    names += [f"{word} about it [{MOMENTS}]" for word in INERTIA]
    scales = [1.0, *(1e3,) * 3, *(1e4,) * 6]
    rows: list[tuple[str, ...]] = []
    for k, (name, scale) in enumerate(zip(names, scales, strict=True)):
        value, std = (scale * float(x[0, k]) for x in (one.uncertainty.links, one.uncertainty.link_std))
        interval = " … ".join(number(scale * float(x[0, k]), 4) for x in (low, high))
        rows.append((name, number(value, 4), number(std, 2), interval))
    rows.append(("torque error without it, with it", *(percent(share) for share in one.torque_error), ""))
    return Table(("quantity, in the frame of the link", "value", "± std", "95 % interval"), tuple(rows))
