"""Is the EDS the drive's? Identity, mapped objects and start-up writes held against the device's own description."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from configparser import Error as SyntaxFault
from functools import lru_cache
from pathlib import Path
from typing import Any

import canopen
from canopen.objectdictionary import datatypes

from config.drive import TEMPERATURE
from config.errors import InputError
from config.schema import Drive, PdoObject
from config.toml_file import shown

_CODES = {
    "u8": datatypes.UNSIGNED8,
    "i8": datatypes.INTEGER8,
    "u16": datatypes.UNSIGNED16,
    "i16": datatypes.INTEGER16,
    "u32": datatypes.UNSIGNED32,
    "i32": datatypes.INTEGER32,
}
_TYPES = {code: name for name, code in _CODES.items()}
_MAY = {"rpdo": ("rw", "rww", "wo"), "tpdo": ("ro", "rw", "rwr", "const")}


def read_eds(path: Path) -> canopen.ObjectDictionary:
    """The object dictionary that ``path`` describes. Raises InputError when it is absent or no EDS (CiA 306)."""
    try:
        return _parsed(path, path.stat().st_mtime_ns)
    except OSError as error:
        raise InputError(shown(path), f"cannot be read ({error.strerror})", "check eds of the drive") from None
    except (SyntaxFault, ValueError, KeyError, AttributeError) as error:
        line = getattr(error, "lineno", None)
        reason = " ".join(str(error).split()) if line is None else f"line {line} is not understood"
        raise InputError(shown(path), f"is not an EDS file ({reason})", "use the vendor's file") from None


def check_eds(drive: Drive, path: Path) -> None:
    """Raise InputError where the drive file ``path`` and its EDS contradict each other.

    Identity (1000, 1018), then for each PDO object: it exists, has the type, may be mapped, and in that direction;
    then each start-up write: it exists and may be written.
    """
    dictionary = read_eds(drive.eds)
    eds, place = shown(drive.eds), shown(path)
    if 0x1000 not in dictionary or 0x1018 not in dictionary:
        raise InputError(eds, "lacks the mandatory objects 1000 or 1018", "use the vendor's file")
    identity = drive.identity
    for key, index, subindex, wanted in (
        ("device_type", 0x1000, 0, identity.device_type),
        ("vendor_id", 0x1018, 1, identity.vendor_id),
        ("product_code", 0x1018, 2, identity.product_code),
        ("revision", 0x1018, 3, identity.revision),
    ):
        variable = variable_at(dictionary, index, subindex)
        described = None if variable is None else variable.default
        if wanted is not None and described is not None and described != wanted:
            raise InputError(
                f"{place}: identity.{key}",
                f"0x{wanted:08X} is not the drive of {eds}, which has 0x{described:08X}",
                "use the EDS of this drive, or correct the identity",
            )
    for number, way, mapped in _mapped(drive):
        problem = _mapping_problem(dictionary, mapped, way)
        if problem:
            raise InputError(
                f"{place}: objects[{number}] ({mapped.name})", f"{problem} in {eds}", "use the EDS of this drive"
            )
    for number, write in enumerate(drive.start_up):
        variable = variable_at(dictionary, write.index, write.subindex)
        object_name = f"{write.index:04X}:{write.subindex:02X}"
        if variable is None:
            raise InputError(f"{place}: start_up[{number}]", f"{object_name} is not in {eds}", "remove or correct it")
        if variable.access_type not in _MAY["rpdo"]:
            raise InputError(f"{place}: start_up[{number}]", f"{object_name} is read-only in {eds}", "remove it")


def variable_at(dictionary: canopen.ObjectDictionary, index: int, subindex: int) -> Any:
    """The variable at ``index:subindex``, None where there is none."""
    entry = dictionary.get(index)
    if entry is None:
        return None
    if isinstance(entry, canopen.objectdictionary.ODVariable):
        return entry if subindex == 0 else None
    # Not entry.get: canopen makes up the entries of an array that the EDS does not list.
    return entry.subindices.get(subindex)


def raw_range(variable: Any) -> tuple[int, int]:
    """Least and greatest raw value that the EDS lets ``variable`` take: its own limits within those of its type."""
    signed = variable.data_type in datatypes.SIGNED_TYPES
    bits = len(variable)
    low, high = (-(1 << (bits - 1)), (1 << (bits - 1)) - 1) if signed else (0, (1 << bits) - 1)
    return (
        low if variable.min is None else max(low, variable.min),
        high if variable.max is None else min(high, variable.max),
    )


def _mapped(drive: Drive) -> Iterator[tuple[int, str, PdoObject]]:
    for number, mapped in enumerate(drive.objects):
        for layout in drive.layouts.values():
            for way, pdos in (("rpdo", layout.rpdo), ("tpdo", layout.tpdo)):
                if any(mapped.name in pdo for pdo in pdos):
                    yield number, way, mapped
        if drive.temperature is not None and mapped.name == TEMPERATURE:
            yield number, "tpdo", mapped


def _mapping_problem(dictionary: canopen.ObjectDictionary, mapped: PdoObject, way: str) -> str:
    variable = variable_at(dictionary, mapped.index, mapped.subindex)
    name = f"{mapped.index:04X}:{mapped.subindex:02X}"
    if variable is None:
        return f"{name} does not exist"
    if variable.data_type != _CODES[mapped.type]:
        return f"{name} is {_TYPES.get(variable.data_type, 'of another type')}, not {mapped.type},"
    if not variable.pdo_mappable:
        return f"{name} cannot be mapped into a PDO"
    if variable.access_type not in _MAY[way]:
        return f"{name} is {variable.access_type} and cannot be mapped into {'an RPDO' if way == 'rpdo' else 'a TPDO'}"
    return ""


@lru_cache(maxsize=32)
def _parsed(path: Path, modified_ns: int) -> canopen.ObjectDictionary:
    logging.getLogger("canopen.objectdictionary.eds").setLevel(logging.ERROR)
    dictionary = canopen.import_od(str(path))
    if not len(dictionary):
        raise ValueError("it describes no objects")
    return dictionary
