"""What people look at: tables, pictures, the HTML report."""

from casysid.report.html import add_report, render_report, write_report
from casysid.report.noise import noise_table
from casysid.report.tables import Table, choice_table, drive_table, error_table, further_drive_table, link_table

__all__ = [
    "Table",
    "add_report",
    "choice_table",
    "drive_table",
    "error_table",
    "further_drive_table",
    "link_table",
    "noise_table",
    "render_report",
    "write_report",
]
