"""The one array type of the package, and how to freeze it."""

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def frozen(values: npt.ArrayLike) -> Array:
    """A read-only float64 copy of ``values``; the very array where it is one already, and no view of another."""
    if type(values) is np.ndarray and values.dtype == np.float64 and values.base is None and not values.flags.writeable:
        return values
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array
