"""The command line: one verb a public function, the same words."""

from casysid.cli.app import main

__all__ = ["main"]
