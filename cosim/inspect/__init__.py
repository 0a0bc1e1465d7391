"""Shows what is inside an FMU, a network, a scenario or a road: `cosim inspect PATH`.

Each kind has a module whose `inspect` returns `Facts`; `kind.recognise` tells them apart by their
content.
"""
