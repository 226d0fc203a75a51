"""What is fuzzed: formats of input, two of results, and the command line."""

import contextlib
import gzip
import io
import json
import shlex
import tempfile
import warnings
import zipfile
import zlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from unittest import mock

import numpy as np
import pyarrow as pa
from pyarrow import feather, parquet
from scipy.io import savemat

from casysid.bundled import find_model
from casysid.errors import ParameterError
from casysid.recording import Recording, read_recording
from casysid.robot import Robot
from tests.fuzz import mutations
from tests.fuzz.harness import Target

JOINTS = ("shoulder", "elbow")
SAMPLES = 120


@cache
def robot() -> Robot:
    """Two links; what is loaded for it later in a child was loaded here once."""
    return Robot.from_file(find_model("two_link.urdf"))


@cache
def columns() -> dict[str, np.ndarray]:
    """A short log with velocities."""
    time = np.arange(SAMPLES) / 100.0
    log = {"time": time}
    for k, name in enumerate(robot().dofs):
        angle = (k + 1.0) * time
        log |= {f"q_{name}": 0.5 * np.sin(angle), f"v_{name}": 0.5 * (k + 1.0) * np.cos(angle)}
        log |= {f"tau_{name}": 0.3 * np.cos(2.0 * angle) + 0.1 * k}
    return log


def numbered() -> dict[str, np.ndarray]:
    """The same, columns numbered."""
    letters = {"q": "q", "v": "dq", "tau": "tau"}
    named = {
        f"{letter}_{name}": f"{new}{k + 1}" for letter, new in letters.items() for k, name in enumerate(robot().dofs)
    }
    return {named.get(name, name): values for name, values in columns().items()}


def text_of(log: dict[str, np.ndarray], delimiter: str = ",") -> bytes:
    rows = zip(*log.values(), strict=True)
    lines = [delimiter.join(log), *(delimiter.join(f"{cell:.6g}" for cell in row) for row in rows)]
    return ("# a comment\n" + "\n".join(lines) + "\n").encode()


def npz_of(log: dict[str, np.ndarray], *, packed: bool = False) -> bytes:
    members = {}
    for name, values in log.items():
        stream = io.BytesIO()
        np.lib.format.write_array(stream, values)
        members[f"{name}.npy"] = stream.getvalue()
    return mutations.zip_of(members, zipfile.ZIP_DEFLATED if packed else zipfile.ZIP_STORED)


def parquet_of(log: dict[str, np.ndarray], **options: object) -> bytes:
    stream = io.BytesIO()
    parquet.write_table(pa.table(log), stream, **options)
    return stream.getvalue()


def dressed() -> tuple[bytes, ...]:
    """The same with units, dates, lists of messages, decimal commas and blanks."""
    log = columns()
    time, motion = log["time"], np.column_stack([log[name] for name in list(log)[1:]])
    rows = [[f"{x:.6g}" for x in row] for row in motion]
    joints = "['" + "', '".join(robot().dofs) + "']"
    lists = [
        f'{t:.9f},"{joints}","[{r[0]}, {r[3]}]","({r[1]} {r[4]})","array([{r[2]}, {r[5]}])"'
        for t, r in zip(time, rows, strict=True)
    ]
    dates = [
        f"2024-05-06T07:08:{t:09.6f}Z;" + ";".join(row).replace(".", ",") for t, row in zip(time, rows, strict=True)
    ]
    blanks = [f"{17 * 10**17 + round(t * 1e9):>22d}  " + "   ".join(row) for t, row in zip(time, rows, strict=True)]
    names = [
        f"{joint}/{word}" for joint in robot().dofs for word in ("position [deg]", "velocity [rpm]", "effort [mNm]")
    ]
    return (
        "\n".join(["stamp,name,position,velocity,effort", *lists]).encode(),
        "\n".join([";".join(["time", *names]), *dates]).encode("utf-16"),
        "\n".join(["%time " + " ".join(name.split()[0] for name in names), *blanks]).encode(),
    )


def feather_of(log: dict[str, np.ndarray]) -> bytes:
    stream = io.BytesIO()
    feather.write_feather(pa.table(log), stream, compression="uncompressed")
    return stream.getvalue()


def mat_of(log: dict[str, np.ndarray]) -> bytes:
    stream = io.BytesIO()
    savemat(stream, log)
    return stream.getvalue()


@cache
def mcap() -> bytes:
    """A bag of joint states."""
    from tests.recording.dialects import Log, write_bag

    log = columns()
    two = {letter: np.column_stack([log[f"{letter}_{name}"] for name in robot().dofs]) for letter in ("q", "v", "tau")}
    with tempfile.TemporaryDirectory() as folder:
        write_bag(
            Path(folder) / "bag", Log(np.round(log["time"] * 1e9).astype(np.int64), **two), 2, "MCAP", robot().dofs
        )
        return next((Path(folder) / "bag").glob("*.mcap")).read_bytes()


def read_log(path: Path) -> None:
    read_recording(path, robot())


def read_model(path: Path) -> None:
    """Every model is read; one in ten of those that load is shown as ``casysid info`` does."""
    from casysid.report.overview import robot_tables

    found = Robot.from_file(path)
    if zlib.crc32(path.read_bytes()) % 10 == 0 and len(found.dofs) <= 20:
        robot_tables(found)


def gzipped(mutation: mutations.Mutation) -> mutations.Mutation:
    """The mutation of what is within."""

    def mutate(data: bytes, other: bytes, rng):  # type: ignore[no-untyped-def]
        with contextlib.suppress(Exception):
            data = gzip.decompress(data)
        with contextlib.suppress(Exception):
            other = gzip.decompress(other)
        return gzip.compress(mutation(data, other, rng), 1, mtime=0)

    return mutate


def model_seeds(suffix: str) -> tuple[bytes, ...]:
    names = ("two_link", "scara", "arm") if suffix == ".urdf" else ("two_link", "scara", "arm", "head")
    files = [find_model(f"{name}{suffix}").read_bytes() for name in names]
    rich = b"""<mujoco model="m"><compiler angle="radian"/><option gravity="0 0 -9"/><size nkey="1"/>
<default><joint damping="1" armature=".1"/></default><asset><hfield name="h" nrow="2" ncol="2" size="1 1 1 1"/>
<mesh name="t" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset><worldbody><replicate count="2" offset="1 0 0">
<body name="b"><joint name="j" axis="0 1 0" range="-1 1"/><geom size=".1"/><frame euler="0 .1 0"><body name="c">
<joint name="k" type="slide"/><geom type="mesh" mesh="t"/></body></frame></body></replicate></worldbody>
<actuator><motor name="a" joint="j0" gear="10" ctrlrange="-1 1"/></actuator></mujoco>"""
    return (*files, rich) if suffix == ".xml" else tuple(files)


@cache
def result_text() -> bytes:
    """A result as ``casysid identify`` writes it, in what is read of it."""
    dofs = robot().dofs
    return json.dumps(
        {
            "samples": {"train": SAMPLES, "held_out": 0},
            "flip": [f"tau_{dofs[0]}"],
            "time_base": {"scale": 1.0, "quasi_static": False},
            "torque_gains": {"gains": dict.fromkeys(dofs, 1.0)},
            "cutoff": {"hz": 6.0},
            "delay": {"seconds": dict.fromkeys(dofs, 0.001)},
            "friction": {dof: {"viscous": 0.1, "coulomb": 0.2, "offset": None, "armature": 0.01} for dof in dofs},
            "friction_model": {
                "columns": [
                    {"kind": "viscous"},
                    {"kind": "coulomb", "width": [0.01] * len(dofs)},
                    {"kind": "offset"},
                    {"kind": "armature"},
                ],
                "couplings": [{"name": "x", "joints": list(dofs), "weights": [1.0, 1.0], "kinds": ["viscous"]}],
            },
        }
    ).encode()


@cache
def recording() -> Recording:
    log, dofs = columns(), robot().dofs
    return Recording(
        channels=robot().channels,
        dofs=dofs,
        time=log["time"],
        position=np.column_stack([log[f"q_{dof}"] for dof in dofs]),
        torque=np.column_stack([log[f"tau_{dof}"] for dof in dofs]),
    )


def read_result(path: Path) -> None:
    """Every result is read; one in ten of those that load predicts torque."""
    from casysid.validation import read_earlier_result, validate

    earlier = read_earlier_result(path)
    if zlib.crc32(path.read_bytes()) % 10 == 0:
        validate(robot(), [recording()], earlier=earlier, cutoff=None if earlier.cutoff else 10.0)


@cache
def design_problem() -> object:
    from casysid.excitation import build_excitation

    return build_excitation(robot())


@cache
def moments_file() -> bytes:
    names = design_problem().information.regressor.names  # type: ignore[attr-defined]
    rows = np.random.default_rng(0).normal(size=(50, len(names) + 1))
    gram = np.repeat((rows.T @ rows)[None, None], robot().nv, axis=1)
    arrays = {"gram": gram, "count": np.full((1, robot().nv), 50.0)}
    return npz_of(arrays | {"columns": np.array(names), "joints": np.array(robot().dofs)}, packed=True)


def read_moments(path: Path) -> None:
    from casysid.excitation import after_result

    (path.parent / "result.json").write_bytes(result_text())
    path = path.replace(path.parent / "moments.npz")
    after_result(design_problem(), path.parent)  # type: ignore[arg-type]


COMMANDS = (
    b"info two_link LOG --gravity 0 0 -9.81 --lock elbow=0.5",
    b"info LOG LOG",
    b"info two_link --floating-base",
    b"identify two_link SHORT --split 0.6 --method wls --consistency full --flip tau_elbow --cutoff 10 --delay 0.001",
    b"identify two_link LOG LOG --held-out LOG --time-scale 1 --noise-position 1e-4,1e-4 --coupling shoulder+elbow",
    b"identify two_link SHORT --noise-velocity 0.1 --noise-acceleration 1 --friction plain --export-inconsistent",
    b"compare two_link SHORT --methods wls,ridge --split 0.5 --friction auto --lock shoulder=1",
    b"validate two_link SHORT --result RESULT --cutoff 10 --flip shoulder --gravity 0 0 -9.81",
    b"excite two_link --period 5 --harmonics 3 --periods 2 --count 1 --rate 100 --criterion d --jerk 99",
    b"excite two_link --clearance 0.01 --floor -1 --box 1,1,1,2,2,2 --wall 0,0,1,-2 --keep-in link2=-1,-1,-1,1,1,1",
    b"excite two_link --start 0.1,0.2 --starts 2 --seed 3 --velocity-share 0.5 --torque-share 0.5 --log RESULT",
    b"rehearse two_link --seed 1 --duration 10 --rate 200 --excitation sinusoids --method ols --lock elbow=0.1",
)


def run_command(path: Path) -> None:
    """The words in a file as arguments of ``casysid``; what would take long is stopped at the last door."""
    from typer.testing import CliRunner

    from casysid.cli.app import app

    try:
        words = shlex.split(path.read_bytes().decode("utf-8", "surrogateescape").replace("\0", ""))
    except ValueError:
        return
    folder = path.parent
    files = {"LOG": folder / "log.csv", "SHORT": folder / "short.csv", "RESULT": folder / "result.json"}
    files["LOG"].write_bytes(text_of(columns()))
    files["SHORT"].write_bytes(b"\n".join(text_of(columns()).splitlines()[:42]) + b"\n")
    files["RESULT"].write_bytes(result_text())
    words = [str(files.get(word, word)) for word in words]
    stop = mock.Mock(side_effect=ParameterError("far enough"))
    doors = ("casysid.excitation.design_set", "casysid.validation.rehearse", "casysid.validation.validate")
    more = ("casysid.identification.identify", "casysid.identification.prepare")
    with contextlib.ExitStack() as stack:
        for door in (*doors, *more):
            stack.enter_context(mock.patch(door, stop))
        answer = CliRunner().invoke(app, [*words, "--out", str(folder / "out")] if words[:1] != ["info"] else words)
    if answer.exception is not None and not isinstance(answer.exception, SystemExit):
        raise answer.exception
    if answer.exit_code not in (0, 2):
        raise AssertionError(f"exit code {answer.exit_code}")


def _logs(suffix: str, write: Callable[[dict[str, np.ndarray]], bytes], *ways: mutations.Mutation) -> Target:
    name = suffix[1:].replace(".", "-")
    seeds = (write(columns()), write(numbered()))
    return Target(name, suffix, seeds, (mutations.blind, *ways), read_log)


@cache
def targets() -> dict[str, Target]:
    """All of them by name."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        blind, tokens, archive, keys = mutations.blind, mutations.tokens, mutations.archive, mutations.keys
        matrices = npz_of({"time": columns()["time"], "q": np.eye(SAMPLES)[:, :2], "tau": np.eye(SAMPLES)[:, :2]})
        plain = npz_of(columns())
        found = (
            _logs(".csv", text_of, tokens),
            _logs(".csv.gz", lambda log: gzip.compress(text_of(log), 1, mtime=0), gzipped(tokens), gzipped(blind)),
            _logs(".parquet", lambda log: parquet_of(log, compression="none"), tokens),
            Target("npz", ".npz", (plain, npz_of(numbered(), packed=True), matrices), (blind, archive), read_log),
            Target("dressed", ".csv", dressed(), (blind, tokens, tokens), read_log),
            _logs(".feather", feather_of, blind),
            _logs(".mat", mat_of, blind),
            Target("mcap", ".mcap", (mcap(),), (blind,), read_log),
            Target("urdf", ".urdf", model_seeds(".urdf"), (blind, tokens, tokens), read_model),
            Target("mjcf", ".xml", model_seeds(".xml"), (blind, tokens, tokens), read_model),
            Target("result", ".json", (result_text(),), (blind, keys, keys, tokens), read_result),
            Target("moments", ".npz", (moments_file(),), (blind, archive), read_moments),
            Target("command", ".txt", COMMANDS, (tokens, words_of_commands), run_command),
        )
    return {target.name: target for target in found}


def words_of_commands(data: bytes, other: bytes, rng) -> bytes:  # type: ignore[no-untyped-def]
    """Words of one command line put into another, taken away, doubled."""
    mine, theirs = data.split(), other.split()
    for _ in range(rng.choice((1, 2, 4))):
        at = rng.randrange(len(mine) + 1)
        if rng.random() < 0.5 and at < len(mine):
            mine[at : at + 1] = rng.choices(theirs, k=rng.choice((0, 1, 1, 2)))
        else:
            mine[at:at] = [*rng.choices((*theirs, *map(str.encode, mutations.NUMBERS)), k=1)]
    return b" ".join(mine)
