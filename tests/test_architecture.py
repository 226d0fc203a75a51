"""The house stands: imports go one way, heavy packages stay in their rooms, files keep to one purpose."""

import ast
import importlib
import inspect
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "casysid"
ORDER = (
    ("errors", "arrays", "archives", "json_reading", "memory", "threads"),
    ("outputs",),
    ("nlp", "inertia"),
    ("robot", "bundled"),
    ("recording", "readers", "dynamics", "kinematics"),
    ("signals", "moments", "moments_file", "accumulation"),
    ("identifiability",),
    ("estimation", "projection", "excitation"),
    ("reaching",),
    ("floating",),
    ("uncertainty", "simulation"),
    ("model",),
    ("identification",),
    ("payload",),
    ("online",),
    ("validation",),
    ("report",),
    ("experiment",),
    ("cli",),
)
LEVEL = {room: level for level, rooms in enumerate(ORDER) for room in rooms}
FILES = sorted(PACKAGE.rglob("*.py"))


def room_of(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imported_modules(path: Path) -> set[str]:
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
    return names


@pytest.mark.parametrize(
    "path",
    [path for path in FILES if room_of(path) not in ("__init__", "__main__")],
    ids=lambda path: str(path.relative_to(PACKAGE)),
)
def test_imports_go_one_way(path):
    own = LEVEL[room_of(path)]
    for module in imported_modules(path):
        parts = module.split(".")
        if parts[0] == "casysid" and len(parts) > 1:
            assert LEVEL[parts[1]] <= own, f"{path.name} imports {module}, which comes after it"


@pytest.mark.parametrize("rooms", [("recording", "readers"), ("identification",), ("estimation",), ("excitation",)])
def test_no_file_imports_itself_through_others(rooms):
    files = {".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts): path for path in FILES}
    inside = {name: path for name, path in files.items() if room_of(path) in rooms}
    graph = {name: (imported_modules(path) - typed_only(path)) & inside.keys() for name, path in inside.items()}
    TopologicalSorter(graph).prepare()  # raises CycleError, which names the files


def test_rooms_of_excitation_import_those_before_them_only():
    order = ("motion", "constraints", "design", "search", "playing")
    for path in (PACKAGE / "excitation").glob("*/*.py"):
        later = order[order.index(path.parent.name) + 1 :]
        for module in imported_modules(path):
            assert not module.startswith(tuple(f"casysid.excitation.{room}" for room in later)), path


def typed_only(path: Path) -> set[str]:
    """Modules that are imported for type checkers only."""
    guards = [
        node
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"
    ]
    return {node.module for guard in guards for node in guard.body if isinstance(node, ast.ImportFrom) and node.module}


def test_choices_know_nothing_of_the_pipeline_that_asks_for_them():
    """What is chosen from the data is chosen from settings and passes, whoever asks."""
    room = PACKAGE / "identification"
    callers = {path.stem for path in room.glob("*") if path.stem != "__init__"} & {
        "choices", "comparison", "links", "output", "pipeline", "prediction", "result", "sources", "verdict",
    }  # fmt: skip
    forbidden = {"casysid.identification", *(f"casysid.identification.{caller}" for caller in callers)}
    assert len(callers) == 9
    for path in (room / "tuning").glob("*.py"):
        assert not imported_modules(path) & forbidden, path.name


@pytest.mark.parametrize(
    ("package", "rooms"),
    [
        ("mujoco", {"robot", "simulation"}),
        ("matplotlib", {"report"}),
        ("rich", {"cli"}),
        ("typer", {"cli"}),
        ("clarabel", {"projection"}),
        ("sklearn", {"estimation"}),
        ("pyarrow", {"readers"}),
        ("dask", {"identification"}),
        ("distributed", {"identification"}),
    ],
)
def test_heavy_packages_stay_in_their_rooms(package, rooms):
    users = {room_of(path) for path in FILES if any(name.split(".")[0] == package for name in imported_modules(path))}
    assert users <= rooms


def test_ipopt_is_called_in_one_place():
    assert {room_of(path) for path in FILES if "nlpsol(" in path.read_text()} <= {"nlp"}


def test_every_public_name_exists_and_is_documented():
    import casysid

    assert casysid.__all__ == sorted(casysid.__all__)
    for name in casysid.__all__:
        assert getattr(casysid, name).__doc__, name


def public_functions():
    """By name: of the package and of every room; rooms' inner modules pass paths among themselves."""
    modules = [importlib.import_module("casysid"), *(importlib.import_module(f"casysid.{room}") for room in LEVEL)]
    found = {}
    for module in modules:
        names = getattr(module, "__all__", [name for name in vars(module) if not name.startswith("_")])
        found.update({name: getattr(module, name) for name in names})
    return {
        name: f for name, f in sorted(found.items()) if inspect.isfunction(f) and f.__module__.startswith("casysid")
    }


@pytest.mark.parametrize("name", public_functions())
def test_paths_may_be_strings(name):
    for argument, parameter in inspect.signature(public_functions()[name]).parameters.items():
        kind = str(parameter.annotation)
        if not kind.startswith("Callable"):  # what casysid calls is given paths
            assert "Path" not in kind or "str" in kind, f"{argument}: {kind}"


def test_importing_the_command_line_loads_nothing_heavy():
    heavy = "casadi pinocchio mujoco scipy sklearn matplotlib pyarrow".split()
    code = f"import sys, casysid, casysid.cli; print([name for name in {heavy} if name in sys.modules])"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "[]"


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_no_file_outgrows_its_purpose(path):
    assert len(path.read_text().splitlines()) <= 400
