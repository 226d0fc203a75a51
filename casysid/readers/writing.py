"""Columns to a file, exactly and all at once: the numbers read back are the numbers written."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Literal

import numpy as np

from casysid.arrays import Array
from casysid.errors import RecordingError
from casysid.outputs import whole_file
from casysid.readers.table import PARQUET_SUFFIXES, SUFFIXES, suffix_of


def write_columns(path: Path, columns: Mapping[str, Array]) -> Path:
    """Write columns of equal length in the format of the path's suffix, replacing the file only when it is complete.

    Raises:
        RecordingError: If the suffix is unknown.
        OutputError: The file cannot be written.
    """
    suffix = suffix_of(path)
    if suffix not in SUFFIXES:
        raise RecordingError(f"{path}: cannot write a recording as '{suffix}'; use one of {', '.join(SUFFIXES)}")
    if not path.parent.is_dir():
        raise RecordingError(f"{path}: no directory {path.parent}; make it first")
    with whole_file(path) as stream:
        if suffix in PARQUET_SUFFIXES:
            _write_parquet(stream, columns)
        elif suffix == ".npz":
            np.savez(stream, **columns)  # type: ignore[arg-type]
        else:
            _write_text(stream, columns, "\t" if ".tsv" in suffix else ",", compressed=suffix.endswith(".gz"))
    return path


def _write_text(stream: IO[bytes], columns: Mapping[str, Array], delimiter: str, *, compressed: bool) -> None:
    import pyarrow as pa
    from pyarrow import csv as pa_csv

    header = io.StringIO()
    ambiguous = any(mark in name for name in columns for mark in ',;\t"')
    quoting: Literal[0, 1] = csv.QUOTE_ALL if ambiguous else csv.QUOTE_MINIMAL
    csv.writer(header, delimiter=delimiter, lineterminator="\n", quoting=quoting).writerow(columns)
    options = pa_csv.WriteOptions(include_header=False, delimiter=delimiter, quoting_style="none")
    with pa.CompressedOutputStream(stream, "gzip") if compressed else pa.PythonFile(stream, "w") as sink:
        sink.write(header.getvalue().encode())
        pa_csv.write_csv(_table(columns), sink, options)


def _write_parquet(stream: IO[bytes], columns: Mapping[str, Array]) -> None:
    from pyarrow import parquet

    parquet.write_table(_table(columns), stream)


def _table(columns: Mapping[str, Array]) -> object:
    import pyarrow as pa

    return pa.table({name: np.ascontiguousarray(values) for name, values in columns.items()})
