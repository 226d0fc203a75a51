"""Names of joints and links as pictures may show them."""

LONGEST = 28
"""Letters: as many as stand beside an axis without squeezing it."""


def as_label(name: str) -> str:
    """A name that Matplotlib draws as it is, cut short: dollar signs set no formula, and it stays on one line."""
    plain = "".join(letter if letter.isprintable() else " " for letter in name)
    short = plain if len(plain) <= LONGEST else f"{plain[: LONGEST - 1]}…"
    return short.replace("$", r"\$")
