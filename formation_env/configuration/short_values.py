"""Wrong values in one short line, whatever was given."""

import reprlib
from collections.abc import Mapping
from itertools import islice
from typing import Any, Final

MAX_VALUE_LENGTH: Final = 80
"""Characters of a wrong value that an error repeats."""
MAX_INTEGER_BITS: Final = 256
"""Integers above this are described by their length: Python refuses to write out very long ones."""


class _ShortRepr(reprlib.Repr):
    """`reprlib.Repr` with the keys of a mapping in their own order."""

    def repr_dict(self, x: Mapping[Any, Any], level: int) -> str:
        """A mapping's first entries."""
        if level <= 0:
            return "{...}"
        items = [f"{self.repr1(k, level - 1)}: {self.repr1(v, level - 1)}" for k, v in islice(x.items(), self.maxdict)]
        return f"{{{', '.join([*items, '...'][: len(x)])}}}"


_SHORT: Final = _ShortRepr()
_SHORT.maxlevel = 3


def shortened(value: Any) -> str:
    """A value in one short line; nested and aliased collections are cut before they are written out."""
    if isinstance(value, Mapping | list | tuple | set):
        return _SHORT.repr(value)[:MAX_VALUE_LENGTH]
    if isinstance(value, str | bytes):
        return repr(value[:MAX_VALUE_LENGTH])
    if isinstance(value, int) and value.bit_length() > MAX_INTEGER_BITS:
        return f"an integer of {value.bit_length()} bits"
    return " ".join(str(value).split())[:MAX_VALUE_LENGTH]
