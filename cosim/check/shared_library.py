"""Shared libraries of Linux (ELF), Windows (PE) and macOS (Mach-O), read without loading them.

Layouts: System V ABI, chapters 4 and 5; Microsoft's PE/COFF specification; Apple's mach-o/loader.h.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Final

ELF_MACHINES: Final = {
    3: "x86", 8: "mips", 20: "ppc32", 21: "ppc64", 40: "aarch32", 62: "x86_64", 183: "aarch64",
    243: "riscv64", 258: "loongarch64",
}  # fmt: skip
PE_MACHINES: Final = {0x14C: "x86", 0x8664: "x86_64", 0xAA64: "aarch64", 0x1C4: "aarch32"}
MACH_MACHINES: Final = {7: "x86", 0x01000007: "x86_64", 0x0100000C: "aarch64", 12: "aarch32"}


@dataclass(frozen=True)
class SharedLibrary:
    """System (`linux`, `windows`, `darwin`), machines, and the functions and data it exports.

    `exports` is None where the file does not tell.
    """

    system: str
    machines: tuple[str, ...]
    exports: frozenset[str] | None


class LibraryError(Exception):
    """The bytes are no shared library of a known kind, or cut short; says what they are."""


def read_library(content: bytes) -> SharedLibrary:
    """Return what a shared library says of itself. Raises `LibraryError`."""
    readers = {
        b"\x7fELF": _elf, b"MZ": _pe, b"\xcf\xfa\xed\xfe": _mach, b"\xce\xfa\xed\xfe": _mach,
        b"\xca\xfe\xba\xbe": _fat,
    }  # fmt: skip
    for magic, reader in readers.items():
        if content.startswith(magic):
            try:
                return reader(content)
            except (struct.error, IndexError, OverflowError):
                raise LibraryError("it is cut short or damaged") from None
    kinds = {
        b"": "it is empty", b"!<arch>": "it is a static library", b"#!": "it is a script",
        b"PK": "it is a ZIP archive", b"version https://git-lfs": "it is a Git LFS pointer, "
        "not the file itself", b"<": "it is a text file",
    }  # fmt: skip
    for start, words in kinds.items():
        if content.startswith(start) if start else not content:
            raise LibraryError(words)
    raise LibraryError(f"it begins with the bytes {content[:4].hex(' ')}")


def _text(content: bytes, at: int) -> str:
    if not 0 <= at < len(content):
        raise IndexError(at)
    return content[
        at : content.index(b"\0", at) if b"\0" in content[at : at + 4096] else at
    ].decode("utf-8", "replace")


# ---------------------------------------------------------------- ELF


def _elf(content: bytes) -> SharedLibrary:
    wide, order = content[4] == 2, "<" if content[5] == 1 else ">"
    kind, machine = struct.unpack_from(order + "HH", content, 16)
    name = ELF_MACHINES.get(machine, f"machine {machine}")
    if kind != 3:
        kinds = {1: "an object file", 2: "a program", 4: "a core dump"}
        raise LibraryError(f"it is {kinds.get(kind, 'an ELF file')}, not a shared library")
    if wide:
        (offset,) = struct.unpack_from(order + "Q", content, 40)
        size, count = struct.unpack_from(order + "HH", content, 58)
    else:
        (offset,) = struct.unpack_from(order + "I", content, 32)
        size, count = struct.unpack_from(order + "HH", content, 46)
    if count and offset + size * count > len(content):
        raise IndexError("sections")
    sections = [_section(content, order, wide, offset + i * size) for i in range(count)]
    tables = [s for s in sections if s[0] == 11]  # SHT_DYNSYM
    exports: set[str] | None = None if not tables else set()
    for _, start, length, link in tables:
        exports = (exports or set()) | _elf_symbols(
            content, order, wide, start, length, sections[link][1]
        )
    return SharedLibrary("linux", (name,), None if exports is None else frozenset(exports))


def _section(content: bytes, order: str, wide: bool, at: int) -> tuple[int, int, int, int]:
    """Type, offset, size and link of a section header."""
    if wide:
        kind, _, _, offset, size, link = struct.unpack_from(order + "IQQQQI", content, at + 4)
    else:
        kind, _, _, offset, size, link = struct.unpack_from(order + "IIIIII", content, at + 4)
    return kind, offset, size, link


def _elf_symbols(
    content: bytes, order: str, wide: bool, start: int, length: int, names: int
) -> set[str]:
    found = set()
    for at in range(start, start + length, 24 if wide else 16):
        if wide:
            name, info, other, section = struct.unpack_from(order + "IBBH", content, at)
        else:
            name, _, _, info, other, section = struct.unpack_from(order + "IIIBBH", content, at)
        if section and info >> 4 in (1, 2, 10) and other & 3 in (0, 3):  # defined, global, visible
            found.add(_text(content, names + name))
    return found


# ---------------------------------------------------------------- PE


def _pe(content: bytes) -> SharedLibrary:
    (head,) = struct.unpack_from("<I", content, 0x3C)
    if content[head : head + 4] != b"PE\0\0":
        raise LibraryError("it is a DOS program, or a damaged DLL")
    machine, count, _, _, _, optional, flags = struct.unpack_from("<HHIIIHH", content, head + 4)
    if not flags & 0x2000:
        raise LibraryError("it is a Windows program, not a DLL")
    start = head + 24
    (magic,) = struct.unpack_from("<H", content, start)
    directory = start + (112 if magic == 0x20B else 96)
    (address,) = struct.unpack_from("<I", content, directory)
    sections = []
    for i in range(count):
        _, where, raw, offset = struct.unpack_from("<IIII", content, start + optional + 40 * i + 8)
        if offset + raw > len(content):
            raise IndexError("sections")
        sections.append((where, raw, offset))
    names = _pe_names(content, sections, address) if address else set()
    name = PE_MACHINES.get(machine, f"machine {machine:#x}")
    return SharedLibrary("windows", (name,), frozenset(names))


def _pe_names(content: bytes, sections: list[tuple[int, int, int]], address: int) -> set[str]:
    def offset(rva: int) -> int:
        for where, raw, start in sections:
            if where <= rva < where + raw:
                return rva - where + start
        raise IndexError(rva)

    table = offset(address)
    (count,) = struct.unpack_from("<I", content, table + 24)
    (pointers,) = struct.unpack_from("<I", content, table + 32)
    if not count:
        return set()
    each = struct.unpack_from(f"<{count}I", content, offset(pointers))
    return {_text(content, offset(pointer)) for pointer in each}


# ---------------------------------------------------------------- Mach-O


def _fat(content: bytes) -> SharedLibrary:
    (count,) = struct.unpack_from(">I", content, 4)
    parts = []
    for i in range(count):
        _, _, offset, size, _ = struct.unpack_from(">IIIII", content, 8 + 20 * i)
        if offset + size > len(content):
            raise IndexError("slices")
        parts.append(_mach(content[offset : offset + size]))
    exports = [part.exports for part in parts if part.exports is not None]
    return SharedLibrary(
        "darwin",
        tuple(machine for part in parts for machine in part.machines),
        frozenset.intersection(*exports) if exports else None,
    )


def _mach(content: bytes) -> SharedLibrary:
    wide = content[0] == 0xCF
    machine, _, kind, count, _ = struct.unpack_from("<IIIII", content, 4)
    if kind not in (6, 8):  # dylib, bundle
        raise LibraryError("it is a macOS program or object file, not a shared library")
    exports: frozenset[str] | None = None
    at = 32 if wide else 28
    for _ in range(count):
        command, size = struct.unpack_from("<II", content, at)
        if command == 2:  # LC_SYMTAB
            exports = _mach_symbols(content, wide, struct.unpack_from("<IIII", content, at + 8))
        at += size
    name = MACH_MACHINES.get(machine, f"machine {machine:#x}")
    return SharedLibrary("darwin", (name,), exports)


def _mach_symbols(content: bytes, wide: bool, table: tuple[int, ...]) -> frozenset[str]:
    symbols, count, names, _ = table
    found = set()
    for i in range(count):
        name, kind = struct.unpack_from("<IB", content, symbols + (16 if wide else 12) * i)
        if not kind & 0xE0 and kind & 0x01 and not kind & 0x10 and kind & 0x0E == 0x0E:
            found.add(_text(content, names + name).removeprefix("_"))
    return frozenset(found)
