"""The sections of a module about its frames, rendered from their templates."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence

import jinja2

from qlinkgen._dataclass import dataclass
from qlinkgen.backends import python_text
from qlinkgen.backends.python.frame_views import PartsView
from qlinkgen.backends.python.kinds import AnyView, KindsView
from qlinkgen.backends.python.ways import Ways, definitions, differing, merged, needed
from qlinkgen.backends.templates import environment
from qlinkgen.model.message import Direction


@functools.cache
def templates() -> jinja2.Environment:
    """The templates of this back-end, with a filter that quotes text."""
    found = environment(__package__)
    found.filters["docstring"] = lambda text: "\n".join(python_text.docstring([text]))
    return found


def way_class(direction: str) -> str:
    """The base class of the messages of a direction, if the directions have different frames."""
    return f"_{direction.title()}"


@dataclass(frozen=True)
class Sections:
    """What is printed about frames before and after the classes.

    Attributes:
        views: the frame of each direction; that of both is called "".
        received: the directions that are decoded.
        based: the directions whose messages have a base class, where directions have different frames.
        beside: frames have values.
    """

    views: Mapping[str, AnyView]
    received: Sequence[Direction]
    based: Sequence[str]
    beside: bool

    @property
    def directed(self) -> bool:
        """Whether the directions have different frames."""
        return len(self.views) > 1

    @property
    def _view(self) -> AnyView:
        return list(self.views.values())[-1]

    def _rendered(self, template: str, view: AnyView, **more: object) -> str:
        found = templates().get_template(f"templates/{template}.j2")
        return found.render(f=view, directed=self.directed, beside=self.beside, **more)

    def _owner(self, way: str) -> str:
        """The class of the messages of a direction."""
        return way_class(way) if way in self.based else "Message"

    @functools.cached_property
    def _made(self) -> Mapping[str, Mapping[str, str]]:
        """Definitions for encoding and for the parts of frames, by direction."""
        return {
            way: definitions(self._rendered("delimited", view, owner=self._owner(way)))
            for way, view in self.views.items()
        }

    @functools.cached_property
    def _found(self) -> Mapping[str, Mapping[str, str]]:
        """Definitions for decoding, by direction."""
        return {
            way: definitions(self._rendered("delimited_search", view)) for way, view in self.views.items()
        }

    @functools.cached_property
    def ways(self) -> Ways:
        """The names that are defined for each direction."""
        if not self.directed:
            return Ways(frozenset())
        return differing([{**made, **self._found[way]} for way, made in self._made.items()])

    @functools.cached_property
    def _of_kinds(self) -> tuple[str, str]:
        """Definitions for encoding and for decoding the frames of each kind; "" if there is one."""
        wrapping, finding, view = [], [], self._view
        if not isinstance(view, KindsView):
            return "", ""
        for kind in (each for each in view.kinds if not each.turned):
            made = definitions(self._rendered("delimited", kind.parts, owner="Message"))
            search = definitions(self._rendered("delimited_search", kind.parts))
            ways, wraps = (
                Ways(frozenset({*made, *search, "_held", "_after"})),
                needed(made, ["_wrapped", "_complete", "_sent"]),
            )
            finds = needed({**made, **search}, ["_split", "_judge"])
            wrapping.append(merged({kind.name: wraps}, ways).strip())
            if kind in view.found:
                others = {name: text for name, text in finds.items() if name not in wraps}
                finding.append(merged({kind.name: others}, ways).strip())
        return "\n\n\n".join(wrapping), "\n\n\n".join(finding)

    @property
    def frame(self) -> str:
        """The section before the classes of messages."""
        view = self._view
        if view.template != "delimited":
            return self._rendered(view.template, view, made=self._of_kinds[0]).strip()
        ended = any(
            isinstance(each, PartsView) and each.after and each.after.values for each in self.views.values()
        )
        message = self._rendered("delimited_message", view, ended=ended)
        if not self.directed:
            return (self._rendered("delimited", view, owner="Message") + message).strip()
        texts = [merged(self._made, self.ways), message]
        for way in self.based:
            text = self._rendered("delimited_way", self.views[way], base=way_class(way), way=way)
            texts.append(self.ways.of(text, way))
        return "\n\n\n".join(text.strip() for text in texts)

    @property
    def search(self) -> str:
        """Functions that find frames in bytes."""
        view = self._view
        if view.template != "delimited":
            return self._of_kinds[1]
        if not self.directed:
            return self._rendered("delimited_search", view)
        received = {way: found for way, found in self._found.items() if way in self.received}
        return merged(received, self.ways).strip()
