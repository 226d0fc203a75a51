"""``python -m casysid``."""

from casysid.cli import main

main()
