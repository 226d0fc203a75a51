"""What is known beside the data, in the words of the command line: weighed links, a total mass, links that stay."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from casysid.cli.ranges import checked

if TYPE_CHECKING:
    from casysid.projection import Knowledge
    from casysid.robot import Robot

TotalMassOption = Annotated[
    float | None,
    typer.Option("--mass-total", metavar="KG", help="Mass of all links that move, together, if they were weighed."),
]
LinkMassOption = Annotated[
    list[str] | None, typer.Option("--mass", metavar="LINK=KG", help="Mass of a weighed link. Repeatable.")
]
KeepOption = Annotated[
    list[str] | None, typer.Option("--keep", metavar="LINK", help="A link that stays as the file has it. Repeatable.")
]


def known_facts(
    robot: Robot, total: float | None, masses: list[str] | None, kept: list[str] | None
) -> tuple[Knowledge, ...]:
    """These facts as knowledge of the projection.

    Raises:
        ParameterError: A link is not there, or a mass is none.
    """
    from casysid.errors import ParameterError
    from casysid.projection import KeptLink, link_mass, total_mass

    facts: list[Knowledge] = []
    if total is not None:
        facts.append(total_mass(robot.links, checked("--mass-total", total)))
    for text in masses or []:
        link, _, value = text.rpartition("=")
        try:
            mass = float(value)
        except ValueError as error:
            raise ParameterError(f"--mass wants LINK=KG, such as --mass forearm=1.2; got {text!r}") from error
        facts.append(link_mass(_link(robot, "--mass", link), checked("--mass", mass)))
    facts += [KeptLink(_link(robot, "--keep", link)) for link in kept or []]
    return tuple(facts)


def _link(robot: Robot, option: str, name: str) -> str:
    from casysid.errors import ParameterError

    if name not in robot.links:
        raise ParameterError(
            f"{option}: robot '{robot.name}' has no moving link called {name!r}; its links are {', '.join(robot.links)}"
        )
    return name
