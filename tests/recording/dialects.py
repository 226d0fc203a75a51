"""One log in the dress that common tools give it: one writer a dialect."""

import gzip
import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import feather, parquet
from scipy.io import savemat

from casysid.recording import Declared

JOINTS = ("shoulder_pan", "shoulder_lift", "elbow", "slide_1")
EPOCH = 1_700_000_000
DEGREE = 180.0 / np.pi
ANGLES = np.array([DEGREE, DEGREE, DEGREE, 1.0])
SHUFFLED = (2, 0, 3, 1)


@dataclass(frozen=True)
class Log:
    """What every dialect tells: whole nanoseconds from the start, and matrices with a column a joint."""

    nanoseconds: np.ndarray
    q: np.ndarray
    v: np.ndarray
    tau: np.ndarray

    @property
    def time(self) -> np.ndarray:
        return self.nanoseconds * 1e-9


@dataclass(frozen=True)
class Dialect:
    """How a log is written.

    Attributes:
        suffix: Of the file.
        write: Writes it.
        digits: To which the numbers are read back (absolute); 0 for all bits.
        declared: What its user has to say.
        warns: What is said of it; empty for nothing.
        lost: Rows at the start that are left out.
    """

    suffix: str
    write: Callable[[Path, Log], None]
    digits: float = 0.0
    declared: Declared = field(default_factory=Declared)
    warns: str = ""
    lost: int = 0


Cells = list[list[str]]


def cells(
    log: Log,
    form: Callable[[float], str] = repr,
    *,
    stamps: list[str] | None = None,
    q: float | np.ndarray = 1.0,
    v: float | np.ndarray = 1.0,
    tau: float = 1.0,
    order: tuple[int, ...] = (0, 1, 2, 3),
    velocity: bool = True,
) -> Cells:
    """Rows of a text: stamps, positions, velocities, torques."""
    blocks = [log.q * q, log.v * v, log.tau * tau] if velocity else [log.q * q, log.tau * tau]
    numbers = np.hstack([block[:, order] for block in blocks])
    times = stamps or [repr(float(t)) for t in log.time]
    return [[stamp, *(form(float(x)) for x in row)] for stamp, row in zip(times, numbers, strict=True)]


def text(header: list[str], rows: Cells, delimiter: str = ",", end: str = "\n") -> str:
    return end.join([delimiter.join(header), *(delimiter.join(row) for row in rows)]) + end


def header(form: str, words: tuple[str, str, str], joints: tuple[str, ...] = JOINTS, time: str = "time") -> list[str]:
    return [time, *(form.format(q=word, j=joint) for word in words for joint in joints)]


NUMBERS = ("1", "2", "3", "4")
ZEROS = ("0", "1", "2", "3")
ROS = ("position", "velocity", "effort")
SHORT = ("q", "dq", "tau")


def plain(form: str, words: tuple[str, str, str], joints: tuple[str, ...] = JOINTS, time: str = "time",
          suffix: str = ".csv", **options: object) -> Dialect:  # fmt: skip
    """Comma separated, all digits, the names by a pattern; joints' names come in another order than the robot's."""
    order = SHUFFLED if joints is JOINTS else (0, 1, 2, 3)

    def write(path: Path, log: Log) -> None:
        names = header(form, words, tuple(joints[k] for k in order), time)
        path.write_text(text(names, cells(log, order=order)))

    return Dialect(suffix, write, **options)  # type: ignore[arg-type]


def dressed(make: Callable[[Log], str], encoding: str = "utf-8", suffix: str = ".csv", **options: object) -> Dialect:
    """A text as some function makes it."""
    return Dialect(suffix, lambda path, log: path.write_bytes(make(log).encode(encoding)) and None, **options)  # type: ignore[arg-type]


def usual(log: Log, delimiter: str = ",", end: str = "\n", **options: object) -> str:
    return text(header("{q}_{j}", ("q", "v", "tau")), cells(log, **options), delimiter, end)  # type: ignore[arg-type]


def nanos(log: Log, scale: int = 1) -> list[str]:
    return [str((EPOCH * 1_000_000_000 + int(t)) // scale) for t in log.nanoseconds]


def rostopic(log: Log) -> str:
    names = [f"field.{word}{k}" for word in ("name", *ROS) for k in range(4)]
    rows = cells(log, stamps=nanos(log), order=SHUFFLED)
    joints = [JOINTS[k] for k in SHUFFLED]
    full = [[row[0], str(n), row[0], "", *joints, *row[1:]] for n, row in enumerate(rows)]
    return text(["%time", "field.header.seq", "field.header.stamp", "field.header.frame_id", *names], full)


def ros2_echo(log: Log) -> str:
    joints = [JOINTS[k] for k in SHUFFLED]
    rows = cells(log, order=SHUFFLED)
    lines = [
        ",".join([str(EPOCH + int(t) // 10**9), str(int(t) % 10**9), "base", *joints, *row[1:]])
        for t, row in zip(log.nanoseconds, rows, strict=True)
    ]
    return "\n".join(lines) + "\n"


def lists(opening: str, closing: str, mark: str = ", ") -> Callable[[Log], str]:
    """Messages' arrays in quoted cells, as bagpy and pandas write them."""

    def make(log: Log) -> str:
        joints = "[" + ", ".join(f"'{JOINTS[k]}'" for k in SHUFFLED) + "]"
        rows = []
        for t, *row in cells(log, order=SHUFFLED):
            parts = [opening + mark.join(row[4 * k : 4 * k + 4]) + closing for k in range(3)]
            rows.append([t, f'"{joints}"', *(f'"{part}"' for part in parts)])
        return text(["Time", "name", *ROS], rows)

    return make


def pairs(log: Log) -> str:
    """Whole seconds and nanoseconds."""
    rows = cells(log)
    full = [
        [str(EPOCH + int(t) // 10**9), f"{int(t) % 10**9:09d}", *row[1:]]
        for t, row in zip(log.nanoseconds, rows, strict=True)
    ]
    return text(["sec", "nanosec", *header("{q}_{j}", ("q", "v", "tau"))[1:]], full)


def dates(log: Log) -> list[str]:
    moments = np.datetime64(EPOCH, "s").astype("datetime64[ns]") + log.nanoseconds.astype("timedelta64[ns]")
    return [f"{moment}Z" for moment in moments]


def units_in_header(log: Log) -> str:
    units = {"q": ["deg", "deg", "deg", "m"], "v": ["deg/s", "deg/s", "deg/s", "m/s"], "tau": ["Nm", "Nm", "Nm", "N"]}
    names = [
        f"{letter}_{joint} [{unit}]" for letter in units for joint, unit in zip(JOINTS, units[letter], strict=True)
    ]
    rows = cells(log, q=ANGLES, v=ANGLES, stamps=[repr(float(t) * 1e3) for t in log.time])
    return text(["time (ms)", *names], rows)


def row_of_units(log: Log) -> str:
    rows = cells(log, q=ANGLES, v=np.array([60, 60, 60, 2 * np.pi]) / (2 * np.pi), tau=1e3)
    units = ["s", *["deg"] * 3, "m", *["rpm"] * 3, "m/s", *["mNm"] * 3, "mN"]
    return text(header("{q}_{j}", ("q", "v", "tau")), [units, *rows], ";")


def blanks(log: Log) -> str:
    names = header("{q}_{j}", ("q", "v", "tau"))
    rows = cells(log, lambda x: f"{x:.15e}")
    return "\n".join("  ".join(f"{cell:>24s}" for cell in row) for row in [names, *rows]) + "\n"


def with_commas(log: Log, delimiter: str, *, zeros: int = 0) -> str:
    first = [["0"] * 13] * zeros
    rows = [*first, *cells(log)[zeros:]]
    return text(header("{q}_{j}", ("q", "v", "tau")), [[c.replace(".", ",") for c in row] for row in rows], delimiter)


def columns(log: Log, words: tuple[str, str, str] = ("q", "v", "tau")) -> dict[str, np.ndarray]:
    named = {f"{word}_{joint}": x[:, k].copy() for word, x in zip(words, (log.q, log.v, log.tau), strict=True)
             for k, joint in enumerate(JOINTS)}  # fmt: skip
    return {"time": log.time} | named


def write_npz(path: Path, log: Log) -> None:
    np.savez(path, times=log.time, positions=log.q, velocities=log.v, torques=log.tau)


def write_list_columns(path: Path, log: Log) -> None:
    parquet.write_table(
        pa.table({"timestamp": log.time, "q": list(log.q), "dq": list(log.v), "tau": list(log.tau)}), path
    )


def write_lerobot(path: Path, log: Log) -> None:
    """A data set of the third version: lists in Parquet, the joints' names in its information."""
    joints = [JOINTS[k] for k in SHUFFLED]
    lists = {"observation.state": log.q, "observation.velocity": log.v, "observation.effort": log.tau, "action": log.q}
    table = {name: list(values[:, SHUFFLED]) for name, values in lists.items()}
    path.parent.joinpath("meta").mkdir()
    features = {name: {"dtype": "float64", "shape": [4], "names": [f"{j}.pos" for j in joints]} for name in lists}
    path.parent.joinpath("meta", "info.json").write_text(json.dumps({"codebase_version": "v3.0", "features": features}))
    parquet.write_table(pa.table({"timestamp": log.time, "episode_index": np.zeros(len(log.q), int)} | table), path)


def write_moments(path: Path, log: Log) -> None:
    moments = np.datetime64(EPOCH, "s").astype("datetime64[ns]") + log.nanoseconds.astype("timedelta64[ns]")
    parquet.write_table(pa.table(columns(log) | {"time": moments}), path)


def write_stream(path: Path, log: Log) -> None:
    table = pa.table(columns(log))
    with pa.ipc.new_stream(path, table.schema) as sink:
        sink.write_table(table, max_chunksize=57)


def write_mat(path: Path, log: Log) -> None:
    savemat(path, {"t": log.time[:, None], "q": log.q, "qd": log.v, "tau": log.tau}, do_compression=True)


def write_structure(path: Path, log: Log) -> None:
    savemat(path, {"data": {"time": log.time, "pos": log.q, "vel": log.v, "torque": log.tau, "name": "run 7"}})


def messages(log: Log, joints: tuple[str, ...]) -> Iterator[tuple[int, list[str], np.ndarray, np.ndarray, np.ndarray]]:
    """Of a joint state's topic that a gripper shares; the joints in another order in every second message."""
    for n, t in enumerate(log.nanoseconds):
        order = SHUFFLED if n % 2 and len(joints) == 4 else tuple(range(len(joints)))
        yield int(t), [joints[k] for k in order], log.q[n, order], log.v[n, order], log.tau[n, order]
        if n % 7 == 3:
            yield int(t) + 1000, ["finger"], np.array([0.01]), np.zeros(0), np.zeros(0)


def write_bag(path: Path, log: Log, version: int, storage: str = "", joints: tuple[str, ...] = JOINTS) -> None:
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_HUMBLE)
    kind = "sensor_msgs/msg/JointState"
    JointState, Header, Time = (
        store.types[name] for name in (kind, "std_msgs/msg/Header", "builtin_interfaces/msg/Time")
    )
    plugin = {} if version == 1 else {"version": 9, "storage_plugin": StoragePlugin[storage]}
    with Writer1(path) if version == 1 else Writer2(path, **plugin) as bag:  # type: ignore[attr-defined]
        link = bag.add_connection("/joint_states", kind, typestore=store)
        for n, (t, names, q, v, tau) in enumerate(messages(log, joints)):
            stamp = Time(sec=EPOCH + t // 10**9, nanosec=t % 10**9)
            head = Header(stamp=stamp, frame_id="", **({"seq": n} if version == 1 else {}))
            message = JointState(header=head, name=names, position=q, velocity=v, effort=tau)
            raw = store.serialize_ros1(message, kind) if version == 1 else store.serialize_cdr(message, kind)
            bag.write(link, EPOCH * 10**9 + t + 5000, raw)


def rqt_plot(log: Log) -> str:
    """pyqtgraph's export: each curve with times of its own."""
    names, numbers = [], []
    for word, values in zip(ROS, (log.q, log.v, log.tau), strict=True):
        for k in range(4):
            names += [f"/joint_states/{word}[{k}]_x", f"/joint_states/{word}[{k}]_y"]
            numbers += [log.time, values[:, k]]
    rows = [[repr(float(x)) for x in row] for row in np.column_stack(numbers)]
    return text([f'"{name}"' for name in names], rows)


def two_topics(log: Log) -> str:
    """PlotJuggler's export with a second topic whose rows leave the joints' cells empty."""
    rows = []
    for row in cells(log):
        rows += [[*row, ""], [repr(float(row[0]) + 1e-3), *[""] * 12, "21.5"]]
    names = header("/joint_states/{j}/{q}", ROS, time="__time")
    return text([*names, "/temperature/value"], rows)


ROUNDING = 1e-12
DIALECTS: dict[str, Dialect] = {
    "casysid": plain("{q}_{j}", ("q", "v", "tau")),
    "by position": plain("{q}_{j}", ROS),
    "joint slash": plain("{j}/{q}", ROS),
    "joint dot": plain("{j}.{q}", ROS),
    "joint underscore": plain("{j}_{q}", ROS),
    "joint short": plain("{j}_{q}", ("pos", "vel", "torque")),
    "joint and blank": plain("{q} {j}", ("angle", "speed", "torque")),
    "measured": plain("measured_{q}_{j}", ("position", "velocity", "torque")),
    "plotjuggler": plain("/joint_states/{j}/{q}", ROS, time="__time"),
    "plotjuggler, two topics": dressed(two_topics, warns="hold none of the columns"),
    "ros2 control": plain("/dynamic_joint_states/{j}.{q}", ROS, time="__time"),
    "numbered": plain("{q}{j}", SHORT, NUMBERS),
    "from zero": plain("{q}{j}", SHORT, ZEROS),
    "brackets": plain("{q}[{j}]", ROS, ZEROS),
    "topic brackets": plain("/joint_states/{q}[{j}]", ROS, ZEROS, time="__time"),
    "rqt_plot": dressed(rqt_plot),
    "camel case": plain("joint{j}{q}", ("Pos", "Vel", "Torque"), NUMBERS),
    "franka": plain("{q}[{j}]", ("q", "dq", "tau_J"), ZEROS),
    "RTDE": plain("actual_{q}_{j}", ("q", "qd", "moment"), ZEROS, time="timestamp"),
    "blanks": dressed(lambda log: usual(log, " "), suffix=".txt"),
    "aligned": dressed(blanks, suffix=".dat", digits=1e-14),
    "tabs": dressed(lambda log: usual(log, "\t"), suffix=".tsv"),
    "semicolons": dressed(lambda log: usual(log, ";")),
    "decimal commas": dressed(lambda log: with_commas(log, ";")),
    "decimal commas and tabs": dressed(lambda log: with_commas(log, "\t"), suffix=".txt"),
    "a first row of zeros": dressed(lambda log: with_commas(log, ";", zeros=1), lost=1, warns="1 single samples"),
    "trailing commas": dressed(lambda log: usual(log).replace("\n", ",\n").replace(",\n", "\n", 1)),
    "trailing commas in the header too": dressed(lambda log: usual(log).replace("\n", ",\n")),
    "carriage returns and a mark": dressed(lambda log: usual(log, end="\r\n"), encoding="utf-8-sig"),
    "UTF-16": dressed(usual, encoding="utf-16"),
    "UTF-16 without a mark": dressed(usual, encoding="utf-16-le"),
    "gzip": Dialect(".csv.gz", lambda path, log: path.write_bytes(gzip.compress(usual(log).encode())) and None),
    "rostopic echo -p": dressed(rostopic),
    "ros2 topic echo --csv": dressed(ros2_echo),
    "lists": dressed(lists("[", "]")),
    "tuples": dressed(lists("(", ")")),
    "numpy arrays": dressed(lists("array([", "])")),
    "arrays without commas": dressed(lists("[", "]", " ")),
    "seconds and nanoseconds": dressed(pairs),
    "nanoseconds": dressed(lambda log: usual(log, stamps=nanos(log))),
    "microseconds": dressed(lambda log: usual(log, stamps=nanos(log, 1000))),
    "milliseconds of a counter": dressed(
        lambda log: usual(log, stamps=[str(int(t) // 10**6) for t in log.nanoseconds]), warns="time is taken as ms"
    ),
    "dates": dressed(lambda log: usual(log, stamps=dates(log))),
    "units in the header": dressed(units_in_header, digits=ROUNDING),
    "units in a row": dressed(row_of_units, digits=ROUNDING),
    "degrees declared": dressed(
        lambda log: usual(log, q=ANGLES, v=ANGLES),
        digits=ROUNDING,
        declared=Declared(units={"position": ("deg",), "velocity": ("deg/s",)}),
    ),
    "mapped": plain(
        "{q}{j}", ("alpha", "beta", "gamma"), ("a", "b", "c", "d"),
        time="tick",
        declared=Declared(
            columns={
                "time": "tick",
                "position": dict(zip(JOINTS, ("alphaa", "alphab", "alphac", "alphad"), strict=True)),
                "velocity": ["betaa", "betab", "betac", "betad"],
                "torque": ["gammaa", "gammab", "gammac", "gammad"],
            }
        ),
    ),
    "plural NPZ": Dialect(".npz", write_npz),
    "list columns": Dialect(".parquet", write_list_columns),
    "LeRobot": Dialect(".parquet", write_lerobot),
    "moments in Parquet": Dialect(".parquet", write_moments),
    "Feather": Dialect(".feather", lambda path, log: feather.write_feather(pa.table(columns(log)), path)),
    "Arrow stream": Dialect(".arrow", write_stream),
    "MATLAB": Dialect(".mat", write_mat),
    "MATLAB structure": Dialect(".mat", write_structure),
    "ROS 1 bag": Dialect(".bag", lambda path, log: write_bag(path, log, 1), warns="hold none of the columns"),
    "ROS 2 bag": Dialect("", lambda path, log: write_bag(path, log, 2, "SQLITE3"), warns="hold none of the columns"),
    "ROS 2 MCAP": Dialect("", lambda path, log: write_bag(path, log, 2, "MCAP"), warns="hold none of the columns"),
}  # fmt: skip
