"""Messages of any reader as dicts, lists and numbers."""

import math


def plain(value):
    if isinstance(value, (bytes, bytearray, memoryview)):
        return list(value)
    if hasattr(value, "tolist"):  # NumPy's
        return plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [plain(one) for one in value]
    if isinstance(value, (str, bool, int)):
        return value
    if isinstance(value, float):
        return "nan" if math.isnan(value) else value
    names = getattr(value, "__dataclass_fields__", None) or value.__slots__
    # Constants of a type, which one reader gives with each message, are upper case.
    return {name: plain(getattr(value, name)) for name in names if not name.startswith("_") and not name.isupper()}
