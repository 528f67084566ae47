"""The device of embreex, which has nothing to do here."""

from __future__ import annotations

from .. import __version__


class EmbreeDevice:
    """A device, for ``EmbreeScene``.

    Examples
    --------
    >>> from antumbra.embreex.rtcore import EmbreeDevice
    >>> str(EmbreeDevice()).startswith("antumbra")
    True
    """

    def __repr__(self) -> str:
        return f"antumbra {__version__} in the place of Embree"
