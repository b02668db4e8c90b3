"""What can be drawn, and put into a table: plots, scenes and frames of whatever is shown."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

from picchio.core.errors import InputError

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes


S = TypeVar("S", bound="Shown")


def named_function(address: str) -> Callable[..., Any]:
    """A function of a later stage, which is loaded when it is called.

    Args:
        address: "module:function" with the module below `picchio`.
    """
    module, _, name = address.partition(":")
    return getattr(import_module(f"picchio.{module}"), name)  # type: ignore[no-any-return]


def seeing(found: S, **arguments: Any) -> S:
    """The same object, which knows what `picchio.view` shows of it.

    Args:
        found: made just now.
        **arguments: of `picchio.view`.
    """
    object.__setattr__(found, "_view", arguments)
    return found


class Shown:
    """What can be drawn: `plot` on matplotlib's axes, `show` as a scene in 3-D.

    Attributes:
        PLOTS: {word: function}, as "module:function" with the module below `picchio`; a function
            takes the object, `ax` and options, and returns the axes. The first is what `plot()`
            draws.
        LACKS: {"plot", "show" or "to_frame": why there is none}.
    """

    __slots__ = ("_view",)  # no field: it is not among a result's values
    PLOTS: ClassVar[Mapping[str, str]] = {}
    LACKS: ClassVar[Mapping[str, str]] = {}

    def plot(self, what: str | None = None, /, **options: Any) -> Axes:
        """Draw it, in a new figure or on the axes given as `ax`.

        Args:
            what: a word of `PLOTS`; the first if not given.
            **options: of the function that draws.

        Returns:
            the axes.

        Raises:
            InputError: there is no such plot.
        """
        what = what or next(iter(self.PLOTS), "")
        if what not in self.PLOTS:
            why = "unknown" if self.PLOTS else self.LACKS["plot"]
            raise InputError(why, key="plot", value=what or type(self).__name__,
                             choices=self.PLOTS)  # fmt: skip
        return named_function(self.PLOTS[what])(self, **options)  # type: ignore[no-any-return]

    def show(self, **options: Any) -> Any:
        """Its scene in 3-D: in a notebook what the cell shows, else in a live meshcat viewer.

        Args:
            **options: of `picchio.view`, such as `joint`.

        Raises:
            InputError: it has no scene.
        """
        if not (seen := self._seen()):
            raise InputError(self.LACKS.get("show", "has no robot by it: it was read from a file"),
                             key="show", value=type(self).__name__)  # fmt: skip
        return named_function("visuals.view:view")(**{**seen, **options}).show()

    def _seen(self) -> Mapping[str, Any]:
        """What `picchio.view` shows of it: its arguments."""
        return getattr(self, "_view", {})

    def to_frame(self) -> pandas.DataFrame:
        """Its table.

        Raises:
            InputError: it has none.
        """
        raise InputError(self.LACKS["to_frame"], key="to_frame", value=type(self).__name__)
