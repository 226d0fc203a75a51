"""Everything that is written: single files whole or not at all, the files of a run all at once."""

from casysid.outputs.files import check_output_file, whole_file, write_whole
from casysid.outputs.manifest import MANIFEST
from casysid.outputs.run_folder import Stage, add_to_run, check_run_folder, run_folder

__all__ = [
    "MANIFEST",
    "Stage",
    "add_to_run",
    "check_output_file",
    "check_run_folder",
    "run_folder",
    "whole_file",
    "write_whole",
]
