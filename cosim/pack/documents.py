"""What a packed FMU says of its network to people: page, licence, and the record for programs."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Collection, Mapping
from typing import Any, Final

PAGE: Final = "documentation/index.html"
LICENCE: Final = "documentation/licenses/license.txt"
RECORD: Final = "extra/org.suspension-cosim/network.json"
_MARK: Final = "<!-- network -->"


def documents(
    files: Mapping[str, bytes], record: Mapping[str, Any], name: str, absent: Collection[str]
) -> dict[str, bytes]:
    """Return page, licence and record of an FMU: `files` are the template's, `record` what is known
    of the network, `absent` the variables that it does not have.
    """
    source, digest = record["file"], record["sha256"]
    licence = (
        f"\nThe network in resources/network.bin was packed from {source} (SHA-256 {digest}).\n"
        "It is under the licence of whoever trained it; the networks that come with\n"
        "suspension-cosim are under the licence at the top of this file.\n"
    )
    return {
        PAGE: _page(files[PAGE].decode(), record, name, absent).encode(),
        LICENCE: files[LICENCE] + licence.encode(),
        RECORD: (json.dumps(record, indent=1, ensure_ascii=False) + "\n").encode(),
    }


def _page(text: str, record: Mapping[str, Any], name: str, absent: Collection[str]) -> str:
    for variable in absent:
        text = re.sub(rf"<tr><td>{re.escape(variable)}</td>.*?</tr>\n?", "", text)
    text = text.replace("<h1>Sensor ", f"<h1>{html.escape(name)} ")
    text = text.replace("<title>Sensor</title>", f"<title>{html.escape(name)}</title>")
    return text.replace(_MARK, _network(record))


def _network(record: Mapping[str, Any]) -> str:
    plain = {k: v for k, v in record.items() if isinstance(v, str | int | float)}
    rows = "".join(
        f"<tr><td>{html.escape(key.replace('_', ' '))}</td><td>{html.escape(str(value))}</td></tr>"
        for key, value in plain.items()
    )
    return (
        f"<h2>Network</h2>\n<table>{rows}</table>\n"
        f"<p>All that the network's file says of itself is in <code>{RECORD}</code>.</p>"
    )
